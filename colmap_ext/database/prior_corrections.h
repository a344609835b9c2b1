// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/sqlite.h"

namespace adasfm {

// What adasfm_global corrected of the priors (docs/reference/formats.md): the
// table adasfm_camera_mount has the one turn by which T_cam_imu was wrong,
// adasfm_inertial_lengths the lengths that it found for priors without one. The
// priors themselves stay as they were imported, so that a second run starts
// from them; a new import removes the corrections. All functions throw
// SqliteError.

// Replaces the true camera frame from the one that T_cam_imu states, none when
// the mount is right, and the lengths: where there are none nothing of the
// table remains. Within the caller's transaction.
void WritePriorCorrections(
    const std::optional<Eigen::Quaterniond>& camera_mount,
    const std::vector<InertialLength>& lengths, SqliteConnection* database);

bool HasPriorCorrections(SqliteConnection* database);
void RemovePriorCorrections(SqliteConnection* database);

// None when there is none.
std::optional<Eigen::Quaterniond> ReadCameraMount(SqliteConnection* database);

// Turns the priors by the camera's mount, where there is one, and adds the
// lengths. Returns the largest scale_sigma of the lengths, 0 without.
double ApplyPriorCorrections(SqliteConnection* database,
                             std::vector<RelativePosePrior>* priors);

}  // namespace adasfm
