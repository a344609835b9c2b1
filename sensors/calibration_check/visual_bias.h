// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>

#include "sensors/calibration_check/rotation_comparison.h"

namespace adasfm {

// By how much visual rotations turn faster than the gyroscope's, rad/s in the
// camera frame, with its mean 1 sigma of an axis.
struct VisualBias {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  double sigma = std::numeric_limits<double>::infinity();
};

// The gyroscope's bias against vision.
//
// Inputs: rotation vectors over the same intervals, in order of their starts;
// map: camera from IMU.
//
// Method. Rotations differ by b dt + o + noise: a bias grows with the interval,
// what two-view geometries have in common (poor geometries, rows exposed one
// after another) does not, and passes for a rate that is the larger the shorter
// the interval (a phone: 0.017 rad/s over 1/6 s, 0.001 over 1 s). Both by
// iteratively reweighted least squares (Cauchy, scale from the median). The
// sigma is the sandwich estimate over blocks of two seconds: intervals overlap,
// and what moves in the scene does so for seconds.
VisualBias EstimateVisualBias(const RotationComparison& data,
                              const Eigen::Matrix3d& map);

}  // namespace adasfm
