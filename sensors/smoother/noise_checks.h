// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/smoother/chain_problem.h"
#include "sensors/smoother/persistence.h"

namespace adasfm {

// Compares the residuals of wheels and accelerometer at the solution with their
// stated noise.
//
// Links are added in sequence, each with its whitened residuals and the
// marginal covariance of its coordinates. Links at rest or without one of the
// two sensors do not count.
class NoiseChecks {
 public:
  void Add(const ChainProblem& chain, size_t k, const LinkResiduals& residuals,
           const LinkCovariance& covariance);
  // Fills the checks, wheel_persistence (from the problem's one) and
  // speed_sigma_ratio.
  void Fill(double problem_persistence, OdometryFusionResult* result);

 private:
  // Squares of residuals divided by their redundancy. Their median is that of
  // the noise as long as most links do not slip, even if the stated noise is so
  // small that most links seem to slip.
  struct RowRatios {
    std::vector<double> values;
    double redundancy = 0.0;

    NoiseCheck Check();
  };

  RowRatios wheel_speed_, wheel_yaw_;
  NoiseCheck accelerometer_;
  Persistence wheel_persistence_;
  std::vector<double> speed_sigma_ratios_;
};

}  // namespace adasfm
