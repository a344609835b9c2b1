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
// adasfm_inertial_lengths the lengths estimated for priors without a length.
// The priors themselves stay as they were imported, so that a second run starts
// from them; a new import removes the corrections. All functions throw
// SqliteError.

// Replaces the correction and the lengths, within the caller's transaction.
// camera_imu_corrections: by camera, rotation to its true frame from the one
// that T_cam_imu states; none where T_cam_imu is right. What is empty gets no
// table.
void WritePriorCorrections(
    const std::map<camera_t, Eigen::Quaterniond>& camera_imu_corrections,
    const std::vector<InertialLength>& lengths, SqliteConnection* database);

bool HasPriorCorrections(SqliteConnection* database);
void RemovePriorCorrections(SqliteConnection* database);

std::map<camera_t, Eigen::Quaterniond> ReadCameraImuCorrections(
    SqliteConnection* database);

}  // namespace adasfm
