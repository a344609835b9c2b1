// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/host/colmap.h"

namespace adasfm {

// Keypoints share errors that no single one shows (calibration, moving cars,
// forward motion), so thousands of them may outvote correct priors. When an
// adjustment leaves the priors farther off than their covariance allows, vision
// had too much weight, and the keypoint sigma is raised until both agree. When
// it leaves them nearer than their covariance lets expect, that covariance is
// too large, and is lowered. This is variance component estimation in which the
// sigmas of priors (but the accelerometer's) are never raised
// (docs/reference/mapper.md).
struct VarianceComponentOptions {
  bool enabled = true;
  // The search begins with the keypoint noise that residuals show
  // (estimate_keypoint_sigma.h), where there are enough.
  bool estimate_keypoint_sigma = true;
  // The adjustment also lowers sigmas of priors that its residuals show to be
  // too large, each kind of term by itself (prior_components.h), and estimates
  // the accelerometer's noise. Together with estimate_keypoint_sigma only,
  // since both need poses near the optimum.
  bool estimate_prior_sigmas = true;
  // The keypoint sigma is raised by at most this factor, so that priors of a
  // wrong calibration do not dominate. Real drives need up to 16: keypoints of
  // 0.27 px that share calibration errors of 4 px.
  double max_sigma_factor = 32.0;
};

// Largest mean squared whitened residual of priors that agree with vision;
// correct priors have 1 or less.
inline constexpr double kMaxPriorMeanSquare = 1.5;

// The largest mean squared whitened residual of a kind of prior term, at the
// reconstruction's poses. Counts priors between images that points constrain,
// too. 0 without priors.
double ComputePriorMeanSquare(const std::vector<PosePriorEdge>& priors,
                              const colmap::Reconstruction& reconstruction);

// AdjustBundle, with the keypoint sigma balanced against the problem's priors.
// keypoint_sigma_factor (>= 1) multiplies the estimated sigma, or
// options.keypoint_sigma_px; the search begins at its value and leaves the
// result there.
PriorBundleAdjustmentSummary AdjustBundleWithVarianceComponents(
    const VarianceComponentOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction, double* keypoint_sigma_factor);

}  // namespace adasfm
