// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "colmap_ext/bundle_adjustment/prior_components.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"

namespace adasfm {

// What a linearised adjustment comes to with other sigmas of its priors.
//
// Method: the normal equations of the reduced system, factorised once for each
// set of sigmas; robust weights of the priors by the residuals of the call
// before. CHOLMOD factorises: with Eigen's scalar factorisation this was 29 %
// of the mapper's time on 1,000 images. The traces of the hat matrix come from
// random signs on all rows (Hutchinson), each one solve: with kNumProbes the
// standard deviation of a redundancy is at most sqrt(2 (1 - share) n /
// kNumProbes) of n residuals.
class LinearAdjustment {
 public:
  static constexpr int kNumProbes = 4;

  // Kept by reference; it holds the priors' information while it is
  // factorised.
  LinearAdjustment(ReducedSystem* system, double prior_loss_scale);
  ~LinearAdjustment();

  // Steps to the optimum with the priors' sigmas times these factors (on top of
  // those of the adjustment), and fills in the components there, with their
  // redundancies. False when the equations are not positive definite.
  bool Solve(const PriorSigmaFactors& factors, PriorComponents* components);
  // Of the unit that an accelerometer tells, at the factors of the last Solve;
  // 0 where none does.
  double UnitVariance() const;

 private:
  // One vector for each of the system's prior rows.
  using RowValues = std::vector<Eigen::VectorXd>;

  // Calls function(row, column, number of the value) for the values of the
  // lower triangle that the i-th rows add to; row and column are theirs.
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
  // In the adjustment's sigmas.
  RowValues residuals_;
  // Square roots; the factors of the sigmas are in them.
  std::vector<double> weights_;
  // The values of system_.rest that the priors add to: where they are, in
  // order, and what they are without priors.
  std::vector<int> changed_;
  std::vector<double> without_priors_;
  struct Factorization;
  std::unique_ptr<Factorization> factorization_;
};

}  // namespace adasfm
