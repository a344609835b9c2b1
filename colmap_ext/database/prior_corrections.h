// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/sqlite.h"

namespace adasfm {

// What adasfm_global corrected of the priors (docs/reference/formats.md): the
// table adasfm_camera_mount has the one turn by which T_cam_imu was wrong, the
// table adasfm_prior_corrections the rotations of priors whose gyroscope vision
// corrected, in cameras turned so. The priors themselves stay as they were
// imported, so that a second run starts from them; a new import removes the
// corrections. All functions throw SqliteError.
struct PriorCorrections {
  // The true camera frame from the one that T_cam_imu states; none when the
  // mount is right.
  std::optional<Eigen::Quaterniond> camera_mount;
  // Only the rotations are kept; empty when they are right.
  std::vector<RelativePosePrior> priors;
};

// Replaces all corrections. The database must have the priors' images. Without
// corrections nothing of the tables remains. Within the caller's transaction.
void WritePriorCorrections(const PriorCorrections& corrections,
                           SqliteConnection* database);

bool HasPriorCorrections(SqliteConnection* database);
void RemovePriorCorrections(SqliteConnection* database);

// None when there is none.
std::optional<Eigen::Quaterniond> ReadCameraMount(SqliteConnection* database);

// Turns the priors by the camera's mount, and gives them their corrected
// rotations, where there are any. Rows are matched by image name.
void ApplyPriorCorrections(SqliteConnection* database,
                           std::vector<RelativePosePrior>* priors);

}  // namespace adasfm
