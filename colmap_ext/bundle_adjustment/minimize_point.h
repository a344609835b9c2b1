// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <algorithm>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"

namespace adasfm {

struct MinimizePointOptions {
  // 0: the point stays.
  int max_num_iterations = 20;
  // Relative decrease of its cost, as the linearised residuals predict it, at
  // which the point stays.
  double function_tolerance = 1e-5;
};

// Moves a point, relative to a camera, by a step of least squares: its
// direction and inverse distance change linearly, as its keypoints depend on
// them, and the point remains in front.
inline Eigen::Vector3d MoveByInverseDistance(const Eigen::Vector3d& point,
                                             const Eigen::Vector3d& step) {
  constexpr double kMaxDecrease = 0.9;  // Of the inverse distance.
  if (point.isZero(0.0)) return step;
  const double decrease = point.dot(step) / point.squaredNorm();
  const Eigen::Vector3d across = step - decrease * point;
  return (point + across) / (1.0 - std::min(decrease, kMaxDecrease));
}

// Moves a point to a minimum of its observations' cost at fixed poses. Returns
// that cost, half of the sum of rho(|r|^2) (`loss` null: of the squares), which
// never exceeds the initial cost.
//
// Method: Gauss-Newton with the current robust weights, by inverse distance
// from the first camera. Its steps are too short where observations contradict
// each other, and a few points (10 to 100 of 20,000) need many. Iterated alone
// between the joint steps (embedded point iterations, Jeong et al. 2010), these
// points do not delay the others.
double MinimizePoint(const MinimizePointOptions& options,
                     const BundleProblem::ObservationRange& observations,
                     const ceres::LossFunction* loss, Eigen::Vector3d* point);

}  // namespace adasfm
