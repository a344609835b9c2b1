// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"

namespace adasfm {

// The terms of one kind of an adjustment's priors: a variance component.
struct PriorComponent {
  // 0 for fewer terms than a statistic needs.
  int num_residuals = 0;
  // Squared norm of each term's whitened residual, until all are added.
  std::vector<double> squares;
  // Mean of the squared whitened residuals, robust against outliers such as
  // wheels that slip for seconds: a residual counts at most three sigmas, or
  // three times the root of this mean where that is more.
  double mean_square = 0.0;
  // Share of the residuals that is redundant (linear_adjustment.h). Correct
  // sigmas give a mean square of this share, not of 1, since poses and shared
  // errors follow the priors where keypoints do not constrain them.
  double redundancy_share = 1.0;
  // The part of redundancy_share that the priors' own errors cause,
  // tr (I - H)^2 over their number (docs/reference/math.md); keypoints cause
  // the other part.
  double own_share = 1.0;

  // The variance of the priors' errors over the stated variance.
  double Chi2PerDof() const { return mean_square / redundancy_share; }
  // The same by a step of Fisher scoring, for a redundancy that changes with
  // the sigma, as it does where vision's noise is much larger.
  double ScoringStep() const;
  // 1 sigma of Chi2PerDof() for independent errors with the stated variance.
  double Chi2Sigma() const;
};

using PriorComponents = std::array<PriorComponent, kNumPriorTerms>;

// Whether keypoints test what the prior's sensors measured. Edges without a
// duration are no measurements, and nothing can contradict edges in gaps.
inline bool IsTestedMeasurement(const PosePriorEdge& edge, PriorTerm term) {
  return edge.dt_s >= 0.0 && edge.is_held_by_points &&
         (term != PriorTerm::kLength || edge.is_length_measured);
}

// Adds a term with this squared whitened residual; FinishPriorComponents sets
// mean_square when all are added.
void AddPriorTerm(PriorTerm term, double squared_residual,
                  PriorComponents* components);
void FinishPriorComponents(PriorComponents* components);

// The components at the reconstruction's poses, with redundancy shares of 1.
PriorComponents ComputePriorComponents(
    const PriorSigmaFactors& factors, const std::vector<PosePriorEdge>& priors,
    const colmap::Reconstruction& reconstruction);

// The largest value of all kinds; 0 without priors.
double LargestMeanSquare(const PriorComponents& components);
double LargestChi2PerDof(const PriorComponents& components);

}  // namespace adasfm
