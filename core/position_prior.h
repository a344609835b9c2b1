// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "core/geodesy.h"
#include "core/types.h"

namespace adasfm {

// One geodetic position of a receiver, with the covariance of its error in
// east, north and up, m^2. Times are on the clock of the receiver.
struct GnssFix {
  timestamp_t timestamp_ns = 0;
  GeodeticPosition position;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

// Position of the antenna of a positioning system at one time, in a world with
// axes in metres:
//   position = (1 - share) A_1 + share A_2 + N(0, covariance),
//   A_k = C_k + R_k^T antenna_in_cam,
// with the pose (R_k, C_k) of image k. A position at the time of one image has
// image_id2 = image_id1 and share = 0; a position between two images constrains
// both.
struct PositionPrior {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  double share = 0.0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  Eigen::Vector3d antenna_in_cam = Eigen::Vector3d::Zero();
};

}  // namespace adasfm
