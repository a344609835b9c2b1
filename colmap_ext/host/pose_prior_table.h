// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {

// Camera positions that COLMAP itself stores in a database: since 3.10 in
// pose_priors (whose columns differ up to 4.0), before that in the columns
// prior_tx, prior_ty, prior_tz of images, as EXIF's latitude, longitude and
// altitude.
struct HostPosition {
  image_t image_id = kInvalidImageId;
  // Latitude and longitude in degrees and altitude in m, or m along three axes.
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  bool is_geodetic = false;
  // None when the host stores none.
  std::optional<Eigen::Matrix3d> covariance;
};

// In order of the images. Skips rows without a finite position or without a
// stated coordinate system. Throws SqliteError for rows that COLMAP could not
// have written.
std::vector<HostPosition> ReadHostPositions(SqliteConnection* database);

// A row of 4.x's pose_priors, in a cartesian frame.
struct NewPosePrior {
  image_t image_id = kInvalidImageId;
  camera_t camera_id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  // Unit vector towards the ground, in the camera frame.
  std::optional<Eigen::Vector3d> gravity_in_cam;
};

// Whether pose_priors has the columns of COLMAP 4.x.
bool HasPosePriorTable(SqliteConnection* database);

// Replaces the rows of these images. Needs HasPosePriorTable.
void WritePosePriors(const std::vector<NewPosePrior>& priors,
                     SqliteConnection* database);

}  // namespace adasfm
