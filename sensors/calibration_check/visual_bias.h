// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>

#include "sensors/calibration_check/rotation_comparison.h"

namespace adasfm {

// Rate by which visual rotations exceed the gyroscope's, rad/s in the camera
// frame, with the mean 1 sigma of an axis.
struct VisualBias {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  double sigma = std::numeric_limits<double>::infinity();
};

// Estimates the gyroscope's bias against vision from rotation vectors over the
// same intervals, in order of their starts. map: camera from IMU.
//
// Rotations differ by b dt + o + noise. The effect of the bias b grows with the
// interval. The offset o, which two-view geometries have in common (poor
// geometries, rows exposed one after another), does not: as a rate it is the
// larger the shorter the interval (a phone: 0.017 rad/s over 1/6 s, 0.001 over
// 1 s). Both are estimated by iteratively reweighted least squares (Cauchy,
// scale from the median). The sigma is the sandwich estimate over blocks of two
// seconds: intervals overlap, and objects in the scene move for seconds. It is
// infinite with too few intervals.
VisualBias EstimateVisualBias(const RotationComparison& data,
                              const Eigen::Matrix3d& map);

}  // namespace adasfm
