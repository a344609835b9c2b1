// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "colmap_ext/bundle_adjustment/prior_components.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"

namespace adasfm {

// Solves a linearised adjustment with other sigmas of its priors.
//
// Method: the normal equations of the reduced system are factorised once for
// each set of sigmas; robust weights of the priors come from the residuals of
// the previous call. CHOLMOD factorises: Eigen's scalar factorisation took 29 %
// of the mapper's time on 1,000 images. The traces of the hat matrix are
// estimated with random signs on all rows (Hutchinson), one solve each: with
// kNumProbes the standard deviation of a redundancy is at most
// sqrt(2 (1 - share) n / kNumProbes) of n residuals.
class LinearAdjustment {
 public:
  static constexpr int kNumProbes = 4;

  // The system is kept by reference; while it is factorised, its matrix
  // contains the priors' information.
  LinearAdjustment(ReducedSystem* system, double prior_loss_scale);
  ~LinearAdjustment();

  // Steps to the optimum with the priors' sigmas times these factors (on top of
  // those of the adjustment), and sets the components at the optimum, with
  // their redundancies. False when the equations are not positive definite.
  bool Solve(const PriorSigmaFactors& factors, PriorComponents* components);
  // Variance of the unit, which an accelerometer determines, at the factors of
  // the last Solve; 0 without one.
  double UnitVariance() const;

 private:
  // One vector for each of the system's prior rows.
  using RowValues = std::vector<Eigen::VectorXd>;

  // Calls function(row, column, index of the value) for the values of the lower
  // triangle that the i-th rows add to; row and column index their `columns`.
  template <typename Function>
  void ForEachValueOf(size_t i, const Function& function) const;
  void FindChangedValues();
  void ComputeWeights(const PriorSigmaFactors& factors);
  bool Factorize();
  // sum of J^T w values over the rows.
  Eigen::VectorXd ToColumns(const RowValues& values) const;
  // w J times the solution for this right hand side.
  RowValues SolveForRows(const Eigen::VectorXd& right_hand_side) const;
  void EstimateRedundancies(PriorComponents* components) const;

  ReducedSystem& system_;
  const double loss_scale_;
  // In units of the adjustment's sigmas.
  RowValues residuals_;
  // Square roots of the weights, including the factors of the sigmas.
  std::vector<double> weights_;
  // The values of system_.rest that the priors add to: their indices in
  // ascending order, and their values without priors.
  std::vector<int> changed_;
  std::vector<double> without_priors_;
  struct Factorization;
  std::unique_ptr<Factorization> factorization_;
};

}  // namespace adasfm
