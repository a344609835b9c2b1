// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/host/colmap.h"

namespace adasfm {

// Keypoints share errors that no single one shows (calibration, moving cars,
// forward motion), so thousands of them may outvote honest priors. The priors
// tell: when an adjustment leaves them further off than their covariance
// allows, vision was believed too much, and its sigma is raised until both
// agree. When it leaves them nearer than their covariance lets expect, that is
// too large, and lowered: variance component estimation, in which priors are
// never blamed (docs/reference/mapper.md).
struct VarianceComponentOptions {
  bool enabled = true;
  // Mean of the squared whitened residuals that priors may have; honest ones
  // have 1 or less.
  double max_mean_square = 1.5;
  // The search begins with the noise of keypoints that their residuals show
  // (estimate_keypoint_sigma.h), where there are enough.
  bool estimate_keypoint_sigma = true;
  // The adjustment also lowers the priors' sigmas that its residuals refute as
  // too large, each kind of term by itself (prior_components.h), and finds the
  // accelerometer's noise. Together with
  // estimate_keypoint_sigma only, since both need poses near the optimum.
  bool estimate_prior_sigmas = true;
  // The keypoint sigma is raised by at most this factor, so that priors of a
  // wrong calibration do not take over. Real drives need up to 16: keypoints
  // of 0.27 px, and calibration errors that they share of 4 px.
  double max_sigma_factor = 32.0;

  bool IsValid(std::string* error) const;
};

// The mean squared whitened residual, at the reconstruction's poses, of the
// priors between images that points hold too: the largest of those of rotation,
// direction and length terms. 0 without priors.
double ComputePriorMeanSquare(const std::vector<PosePriorEdge>& priors,
                              const colmap::Reconstruction& reconstruction);

// AdjustBundle, with the keypoint sigma balanced against the problem's priors.
// keypoint_sigma_factor (>= 1) multiplies the estimated sigma, or
// options.keypoint_sigma_px; it is where the search begins and holds what was
// found.
PriorBundleAdjustmentSummary AdjustBundleWithVarianceComponents(
    const VarianceComponentOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction, double* keypoint_sigma_factor);

}  // namespace adasfm
