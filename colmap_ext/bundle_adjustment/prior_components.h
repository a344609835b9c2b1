// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"

namespace adasfm {

// The terms of one kind that an adjustment's priors have: a component of
// variance.
struct PriorComponent {
  // 0 for fewer terms than a statistic needs.
  int num_residuals = 0;
  // Of each term, the squared norm of its whitened residual, until all are
  // added.
  std::vector<double> squares;
  // Mean of the squared whitened residuals without its outliers, so that wheels
  // which slip for seconds do not speak for all: of residuals beyond three
  // sigmas, and beyond three times this, as much counts.
  double mean_square = 0.0;
  // The share of the residuals that the adjustment leaves free: honest sigmas
  // give a mean square of this, since poses and shared errors follow the
  // priors where keypoints do not hold them. Of linear_adjustment.h.
  double redundancy_share = 1.0;
  // Of it, what the priors' own errors bring, tr (I - H)^2 over their number
  // (docs/reference/math.md); the rest comes from keypoints.
  double own_share = 1.0;

  // The variance of the priors' errors as a share of the stated one.
  double Chi2PerDof() const { return mean_square / redundancy_share; }
  // The same where the redundancy changes with the sigma, as it does where
  // vision's noise is much larger: a step of Fisher scoring.
  double ScoringStep() const;
  // 1 sigma of that variance, where it is 1, of independent errors.
  double Chi2Sigma() const;
};

using PriorComponents = std::array<PriorComponent, kNumPriorTerms>;

// Whether keypoints test what the prior's sensors measured: edges without a
// duration are no measurements, and those in gaps have nothing to contradict
// them.
inline bool IsTestedMeasurement(const PosePriorEdge& edge, PriorTerm term) {
  return edge.dt_s >= 0.0 && edge.is_held_by_points &&
         (term != PriorTerm::kLength || edge.is_length_measured);
}

// Adds a term of this squared whitened residual; mean_square is known when all
// are added.
void AddPriorTerm(PriorTerm term, double squared_residual,
                  PriorComponents* components);
void FinishPriorComponents(PriorComponents* components);

// The components at the reconstruction's poses, with redundancy shares of 1.
PriorComponents ComputePriorComponents(
    const PriorSigmaFactors& factors, const std::vector<PosePriorEdge>& priors,
    const colmap::Reconstruction& reconstruction);

// The largest of the kinds; 0 without priors.
double LargestMeanSquare(const PriorComponents& components);
double LargestChi2PerDof(const PriorComponents& components);

}  // namespace adasfm
