// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "colmap_ext/bundle_data.h"
#include "colmap_ext/bundle_solver.h"

namespace adasfm {
namespace {

bool CheckPositive(const char* name, double value, std::string* error) {
  if (std::isfinite(value) && value > 0.0) return true;
  std::ostringstream message;
  message << name << " is " << value << ", but must be positive";
  *error = message.str();
  return false;
}

bool HasLengths(const std::vector<PosePriorEdge>& priors) {
  return std::any_of(priors.begin(), priors.end(), [](const auto& edge) {
    return std::isfinite(edge.length_sigma_m);
  });
}

}  // namespace

PosePriorEdge PosePriorEdgeFromPrior(const RelativePosePrior& prior) {
  PosePriorEdge edge;
  edge.image_id1 = prior.image_id1;
  edge.image_id2 = prior.image_id2;
  edge.cam2_from_cam1 = prior.cam2_from_cam1;
  const auto sigma_or_infinity = [](double variance) {
    return std::isfinite(variance) && variance > 0.0
               ? std::sqrt(variance)
               : std::numeric_limits<double>::infinity();
  };
  if (prior.HasRotation()) {
    edge.rotation_sigma_rad =
        sigma_or_infinity(prior.covariance.topLeftCorner<3, 3>().trace() / 3.0);
  }
  const Eigen::Vector3d& translation = prior.cam2_from_cam1.translation;
  const double length = translation.norm();
  if (!std::isfinite(length) || length <= 0.0) return edge;
  const Eigen::Matrix3d covariance = prior.covariance.bottomRightCorner<3, 3>();
  const Eigen::Vector3d direction = translation / length;
  const double variance_along = direction.dot(covariance * direction);
  const double variance_across = (covariance.trace() - variance_along) / 2.0;
  if (prior.HasLength())
    edge.length_sigma_m = sigma_or_infinity(variance_along);
  if (prior.HasDirection()) {
    edge.direction_sigma_rad = sigma_or_infinity(variance_across) / length;
  }
  // A motion that drowns in its own noise has no direction.
  if (edge.direction_sigma_rad > 0.5) {
    edge.direction_sigma_rad = std::numeric_limits<double>::infinity();
  }
  return edge;
}

bool PriorBundleAdjustmentOptions::IsValid(std::string* error) const {
  if (!CheckPositive("keypoint_sigma_px", keypoint_sigma_px, error) ||
      !CheckPositive("prior_loss_scale", prior_loss_scale, error)) {
    return false;
  }
  if (!std::isfinite(reproj_loss_scale_px)) {
    *error = "reproj_loss_scale_px must be finite";
    return false;
  }
  if (max_num_iterations < 1) {
    *error = "max_num_iterations is " + std::to_string(max_num_iterations) +
             ", but must be at least 1";
    return false;
  }
  if (!(function_tolerance >= 0.0)) {
    *error = "function_tolerance must not be negative";
    return false;
  }
  if (max_num_images_sparse < max_num_images_dense) {
    *error = "max_num_images_sparse is " +
             std::to_string(max_num_images_sparse) +
             ", but must not be less than max_num_images_dense";
    return false;
  }
  return true;
}

PriorBundleAdjustmentSummary AdjustBundle(
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);

  const auto start = std::chrono::steady_clock::now();
  PriorBundleAdjustmentSummary summary;
  BundleData data(options, problem, *reconstruction);
  summary.num_images = data.NumFreeImages();
  summary.num_points = static_cast<int>(data.points.size());
  summary.num_residuals = data.NumResiduals();
  if (summary.num_images == 0 || summary.num_residuals == 0) {
    summary.message = "nothing to adjust";
    return summary;
  }
  data.FixGauge(HasLengths(problem.priors));
  if (options.refine_focal_length || options.refine_principal_point ||
      options.refine_extra_params) {
    SolveBundleWithCameras(options, &data, reconstruction, &summary);
  } else {
    SolveBundle(options, &data, &summary);
  }
  summary.success = summary.success && data.IsFinite();
  if (summary.success) data.WriteTo(reconstruction);
  summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  return summary;
}

}  // namespace adasfm
