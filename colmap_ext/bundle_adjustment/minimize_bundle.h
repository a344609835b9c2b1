// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/bundle_adjustment/minimize_point.h"

namespace adasfm {

class BundleProblem;

// Limit of gradients and, relative to the parameters, of steps.
inline constexpr double kGradientAndStepTolerance = 1e-12;

struct MinimizeBundleOptions {
  int max_num_iterations = 50;
  // Relative change of the cost at which the minimum is found.
  double function_tolerance = 1e-5;
  // Initial radius of the trust region; the damping is its inverse.
  double initial_radius = 1e4;
  // Iterations of each point alone, after each joint step (minimize_point.h).
  int max_num_point_iterations = MinimizePointOptions().max_num_iterations;
  // Joint steps move points by their inverse distances (minimize_point.h). Else
  // as Ceres does.
  bool moves_inverse_distances = true;
  int num_threads = 1;  // For the loops of BundleReducer.
};

struct MinimizeBundleSummary {
  // Whether the parameters may be used. Their cost never exceeds the initial
  // one.
  bool success = false;
  // The start counts as one.
  int num_iterations = 0;
  int num_factorizations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  std::string message;
};

// Moves the parameters of a problem that keeps its points apart to the minimum
// of its cost.
//
// Method: Levenberg-Marquardt with the rules of Ceres for damping, acceptance
// and end; the normal equations of bundle_reducer.h, factorised by CHOLMOD or,
// where that takes longer, solved by conjugate gradients with the last factor
// as preconditioner. Unlike in Ceres, each point is minimised alone after each
// step, and the last step is kept. On failure, where no step is possible, the
// parameters are the best found.
MinimizeBundleSummary MinimizeBundle(const MinimizeBundleOptions& options,
                                     BundleProblem* bundle);

}  // namespace adasfm
