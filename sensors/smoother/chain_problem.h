// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/smoother/chain_elimination.h"
#include "sensors/smoother/odometry_factors.h"

namespace adasfm {

// The smoother's least-squares problem with the current values of its unknowns
// (states, globals) and the weights of the links' wheels.
struct ChainProblem {
  // Starts at the problem's initial states. Keeps references to both arguments.
  ChainProblem(const OdometryFusionProblem& problem,
               const OdometryFusionOptions& options);

  size_t NumLinks() const { return problem.links.size(); }
  LinkResiduals Residuals(size_t k) const;
  // The normal equations of link k.
  LinkEquations Equations(size_t k) const;
  // The normal equations of the priors of the first state and of the globals.
  ChainMessage FirstMessage() const;
  // Half of the sum of squares of all residuals.
  double Cost() const;

  const OdometryFusionProblem& problem;
  const OdometryFusionOptions& options;
  std::vector<double> wheel_weights;  // one per link
  std::vector<ChainState> states;     // one more than links
  ChainGlobals globals;

 private:
  Eigen::Vector3d InitialStep(size_t k) const;
};

}  // namespace adasfm
