// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/find_focal_length_error.h"

#include <cmath>

namespace adasfm {
namespace {

// Calibrations of one camera differ by some tenths of a per cent.
constexpr double kMinRatio = 0.005;

}  // namespace

std::optional<double> FindFocalLengthError(
    const PriorBalanceOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    const colmap::Reconstruction& reconstruction) {
  PriorBundleAdjustmentOptions trial_options = options;
  trial_options.refine_focal_length = true;
  colmap::Reconstruction trial = reconstruction;
  if (!AdjustBundle(trial_options, problem, &trial).success ||
      ComputePriorChi2PerDof(problem.priors, trial) >
          balance.max_chi2_per_dof) {
    return std::nullopt;
  }
  double farthest = 1.0;
  for (const auto& [camera_id, camera] : reconstruction.Cameras()) {
    const double ratio =
        trial.Camera(camera_id).MeanFocalLength() / camera.MeanFocalLength();
    if (std::abs(ratio - 1.0) > std::abs(farthest - 1.0)) farthest = ratio;
  }
  if (std::abs(farthest - 1.0) < kMinRatio) return std::nullopt;
  return farthest;
}

}  // namespace adasfm
