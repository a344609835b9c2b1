// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"

namespace adasfm {

struct SettlePointOptions {
  // 0: the point stays.
  int max_num_iterations = 20;
  // Relative decrease of its cost, as the linearised residuals predict it, at
  // which the point stays.
  double function_tolerance = 1e-5;
};

// Moves a point to a minimum of its observations' cost, by poses as they are;
// returns that cost (half of the sum of rho(|r|^2), `loss` null: of the
// squares), which is never more than at the start.
//
// Method: Gauss-Newton with the robust weights of the moment. Its steps are too
// short where observations contradict each other, and a few points (10 to 100
// of 20,000) need many. Alone, between the steps of all parameters (embedded
// point iterations, Jeong et al. 2010), they hold nothing else up.
double SettlePoint(const SettlePointOptions& options,
                   const BundleProblem::ObservationRange& observations,
                   const ceres::LossFunction* loss, Eigen::Vector3d* point);

}  // namespace adasfm
