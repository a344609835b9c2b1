// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace adasfm {

// A keypoint as a ray, with the derivative that converts errors of directions
// to pixels without the camera model (pinhole and fisheye alike).
struct Bearing {
  // Unit vector in the camera frame.
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  // d direction / d pixel, 3x2, in 1/px: a constraint n . direction = e has the
  // image distance |e| / |jacobian^T n| px, to first order.
  Eigen::Matrix<double, 3, 2> jacobian = Eigen::Matrix<double, 3, 2>::Zero();
};

}  // namespace adasfm
