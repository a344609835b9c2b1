// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <vector>

#include "core/inertial_motion.h"
#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {

// Corrections of the priors by adasfm_global (docs/reference/formats.md). The
// table adasfm_camera_mount has the rotations by which T_cam_imu was wrong,
// adasfm_time_shifts what timeshift_cam_imu lacked, adasfm_gyroscope_scales by
// what the gyroscope's rates have to grow, adasfm_inertial_lengths the lengths
// estimated for priors without a length.
// The priors themselves stay as they were imported, so that a second run starts
// from them; a new import removes the corrections. All functions throw
// SqliteError.

struct PriorCorrections {
  // By camera, rotation to its true frame from the one that T_cam_imu states;
  // none where T_cam_imu is right.
  std::map<camera_t, Eigen::Quaterniond> camera_imu;
  std::map<camera_t, double> time_shift_s;  // by camera, s
  // By camera, in its true frame (CorrectGyroscopeScales).
  std::map<camera_t, Eigen::Vector3d> gyroscope_scales;
  std::vector<InertialLength> lengths;
};

// Replaces the corrections, within the caller's transaction. What is empty gets
// no table.
void WritePriorCorrections(const PriorCorrections& corrections,
                           SqliteConnection* database);

bool HasPriorCorrections(SqliteConnection* database);
void RemovePriorCorrections(SqliteConnection* database);

std::map<camera_t, Eigen::Quaterniond> ReadCameraImuCorrections(
    SqliteConnection* database);
std::map<camera_t, double> ReadTimeShifts(SqliteConnection* database);
std::map<camera_t, Eigen::Vector3d> ReadGyroscopeScales(
    SqliteConnection* database);

}  // namespace adasfm
