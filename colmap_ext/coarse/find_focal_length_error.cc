// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/find_focal_length_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/so3.h"

namespace adasfm {
namespace {

// Calibrations of one camera differ by some tenths of a per cent.
constexpr double kMinRatio = 0.003;
// Priors share errors from step to step, which the cost's change does not show.
// Against a measured focal length many sigmas are needed. Scales of the
// gyroscope pass for up to kMinSigma of focal length
// (docs/reference/global.md).
constexpr double kMinNumSigmas = 10.0;
constexpr double kMinNumSigmasOfUnknown = 3.0;
constexpr double kMinSigma = 0.0025;
// Single units of the costs' difference count, so adjustments have to converge
// closer than elsewhere.
constexpr double kFunctionTolerance = 1e-7;
// Straight on, such errors pass for 8 % of focal length; turns separate them.
constexpr double kMinTurnDeg = 20.0;
// One focal length needs no more, and the time stays bounded.
constexpr size_t kMaxNumImages = 300;

// The consecutive images, by their priors, with most rotation: a straight drive
// does not observe focal lengths.
PriorBundleAdjustmentProblem SelectImages(
    const PriorBundleAdjustmentProblem& problem) {
  const std::vector<PosePriorEdge>& priors = problem.priors;
  if (problem.images.size() <= kMaxNumImages || priors.size() < kMaxNumImages) {
    return problem;
  }
  std::vector<double> turn = {0.0};
  for (const PosePriorEdge& prior : priors) {
    const double angle = std::isfinite(prior.rotation_sigma_rad)
                             ? LogSo3(prior.cam2_from_cam1.rotation).norm()
                             : 0.0;
    turn.push_back(turn.back() + angle);
  }
  const size_t length = kMaxNumImages - 1;
  size_t best = 0;
  for (size_t k = 0; k + length < turn.size(); ++k) {
    if (turn[k + length] - turn[k] > turn[best + length] - turn[best]) best = k;
  }
  PriorBundleAdjustmentProblem selected;
  selected.constant_cameras = problem.constant_cameras;
  selected.priors.assign(priors.begin() + best, priors.begin() + best + length);
  for (const PosePriorEdge& prior : selected.priors) {
    selected.images.insert({prior.image_id1, prior.image_id2});
  }
  return selected;
}

// The largest rotation from the drive's first orientation.
double LargestTurnRad(const std::vector<PosePriorEdge>& priors) {
  Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
  double largest = 0.0;
  for (const PosePriorEdge& prior : priors) {
    if (!std::isfinite(prior.rotation_sigma_rad)) continue;
    turned = prior.cam2_from_cam1.rotation * turned;
    largest = std::max(largest, LogSo3(turned).norm());
  }
  return largest;
}

// The camera whose ratio is farthest from 1; the sigma is not set.
FocalLengthError FindFarthest(const colmap::Reconstruction& before,
                              const colmap::Reconstruction& after) {
  FocalLengthError farthest;
  for (const auto& [camera_id, camera] : before.Cameras()) {
    const double ratio =
        after.Camera(camera_id).MeanFocalLength() / camera.MeanFocalLength();
    if (std::abs(ratio - 1.0) > std::abs(farthest.ratio - 1.0)) {
      farthest.camera_id = camera_id;
      farthest.ratio = ratio;
    }
  }
  return farthest;
}

// Whether all tested cameras are marked as having a measured focal length.
bool HasPriorFocalLengths(const std::set<camera_t>& constant_cameras,
                          const colmap::Reconstruction& reconstruction) {
  return std::all_of(reconstruction.Cameras().begin(),
                     reconstruction.Cameras().end(), [&](const auto& entry) {
                       return HasPriorFocalLength(entry.second) ||
                              constant_cameras.count(entry.first) > 0;
                     });
}

}  // namespace

std::optional<FocalLengthError> FindFocalLengthError(
    const PriorBundleAdjustmentOptions& given_options,
    const PriorBundleAdjustmentProblem& whole_problem,
    const colmap::Reconstruction& reconstruction) {
  const PriorBundleAdjustmentProblem problem = SelectImages(whole_problem);
  if (LargestTurnRad(problem.priors) < DegToRad(kMinTurnDeg)) {
    return std::nullopt;
  }
  // In the course of adjustments wrong points fall behind their cameras, or
  // away from them. Two costs are comparable only where the same points have.
  // So the given lens is adjusted once more, after the free one.
  PriorBundleAdjustmentOptions options = given_options;
  options.function_tolerance = kFunctionTolerance;
  colmap::Reconstruction free = reconstruction;
  AdjustBundle(options, problem, &free);
  PriorBundleAdjustmentOptions free_options = options;
  free_options.refine_focal_length = true;
  const PriorBundleAdjustmentSummary with_free =
      AdjustBundle(free_options, problem, &free);
  colmap::Reconstruction given = free;
  for (const auto& [camera_id, camera] : reconstruction.Cameras()) {
    ParamsOf(&given.Camera(camera_id)) = ParamsOf(camera);
  }
  const PriorBundleAdjustmentSummary with_given =
      AdjustBundle(options, problem, &given);
  if (!with_given.success || !with_free.success ||
      ComputePriorMeanSquare(
          CorrectSharedErrors(options.shared_errors, with_free.shared_errors,
                              problem.priors),
          free) > kMaxPriorMeanSquare) {
    return std::nullopt;
  }
  // Half the squares of the residuals are the cost.
  const double variance =
      std::max(1.0, 2.0 * with_free.final_cost / with_free.num_residuals);
  const double num_sigmas = std::sqrt(
      2.0 * std::max(0.0, with_given.final_cost - with_free.final_cost) /
      variance);
  FocalLengthError error = FindFarthest(reconstruction, free);
  const double min_num_sigmas =
      HasPriorFocalLengths(problem.constant_cameras, reconstruction)
          ? kMinNumSigmas
          : kMinNumSigmasOfUnknown;
  if (std::abs(error.ratio - 1.0) < kMinRatio || num_sigmas < min_num_sigmas) {
    return std::nullopt;
  }
  error.sigma = std::hypot(std::abs(error.ratio - 1.0) / num_sigmas, kMinSigma);
  return error;
}

}  // namespace adasfm
