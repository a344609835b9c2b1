// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/sqlite.h"

namespace adasfm {

// Corrections of the priors by adasfm_global (docs/reference/formats.md). The
// table adasfm_camera_mount has the rotation by which T_cam_imu was wrong,
// adasfm_inertial_lengths the lengths estimated for priors without a length.
// The priors themselves stay as they were imported, so that a second run starts
// from them; a new import removes the corrections. All functions throw
// SqliteError.

// Replaces the correction and the lengths, within the caller's transaction.
// camera_imu_correction: rotation to the true camera frame from the one that
// T_cam_imu states; none when T_cam_imu is right. What is absent gets no table.
void WritePriorCorrections(
    const std::optional<Eigen::Quaterniond>& camera_imu_correction,
    const std::vector<InertialLength>& lengths, SqliteConnection* database);

bool HasPriorCorrections(SqliteConnection* database);
void RemovePriorCorrections(SqliteConnection* database);

// None when the database has no correction.
std::optional<Eigen::Quaterniond> ReadCameraImuCorrection(
    SqliteConnection* database);

// Rotates the priors by the camera-IMU correction, if there is one, and adds
// the lengths. Returns the largest scale_sigma of the lengths, 0 without
// lengths.
double ApplyPriorCorrections(SqliteConnection* database,
                             std::vector<RelativePosePrior>* priors);

}  // namespace adasfm
