// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"

namespace adasfm {

// The terms of one kind that an adjustment's priors have: a component of
// variance.
struct PriorComponent {
  int num_residuals = 0;
  // Mean of the squared whitened residuals; each term counts at most 25 per
  // residual, so that a slipping wheel does not speak for all.
  double mean_square = 0.0;
  // The share of the residuals that the adjustment leaves free: honest sigmas
  // give a mean square of this, since poses and shared errors follow the
  // priors where keypoints do not hold them.
  double redundancy_share = 1.0;
  // Of it, what the priors' own errors bring, tr (I - H)^2 over their number
  // (docs/reference/math.md); the rest comes from keypoints.
  double own_share = 1.0;

  // Of fewer terms than a statistic needs: 0.
  double Chi2PerDof() const;
  // The variance of the priors' errors as a share of the stated one, by
  // Helmert's equation for this component alone.
  double VarianceFactor() const;
  // 1 sigma of it, of independent errors.
  double VarianceFactorSigma() const;
};

using PriorComponents = std::array<PriorComponent, kNumPriorTerms>;

// The components at the reconstruction's poses, with redundancy shares of 1.
// Edges without a duration are no measurements of sensors, and those in gaps
// have nothing to contradict them: they take no part.
PriorComponents ComputePriorComponents(
    const PriorSigmaFactors& factors, const std::vector<PosePriorEdge>& priors,
    const colmap::Reconstruction& reconstruction);

// Fills in the redundancy shares at an adjustment's optimum.
//
// Method: the trace of the matrix that maps errors of the priors to errors of
// the adjusted motions, by random probing (Kusche 2003): every prior is moved
// by a random sign times a part of its sigma, the adjustment repeated, and what
// the motions follow is summed by the same signs. The standard deviation is at
// most sqrt(2 (1 - share) n) of n residuals.
//
// On failure the shares stay as they are, and the return value is false.
bool EstimateRedundancies(const PriorBundleAdjustmentOptions& options,
                          const PriorBundleAdjustmentProblem& problem,
                          const SharedErrors& shared_errors,
                          const colmap::Reconstruction& reconstruction,
                          PriorComponents* components);

// How many sigmas the prior's worst term is off; 0 when an image is missing.
double LargestNumSigmas(const PosePriorEdge& prior,
                        const colmap::Reconstruction& reconstruction);

// The largest chi-square per degree of freedom; 0 without priors.
double LargestChi2PerDof(const PriorComponents& components);

}  // namespace adasfm
