// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/create_reprojection_cost.h"

#include <ceres/autodiff_cost_function.h>

#include "colmap_ext/host/visit_camera_model.h"

namespace adasfm {

// Largest error, in px, of a keypoint undistorted and projected again.
static constexpr double kMaxUndistortionErrorPx = 0.5;

bool NormalizeKeypoint(const colmap::Camera& camera, const Eigen::Vector2d& xy,
                       double sigma_px, NormalizedKeypoint* keypoint) {
  // Half a pixel to either side: exact for pinholes, else an error of second
  // order.
  const double step = 0.5 / camera.MeanFocalLength();
  const Eigen::Vector2d normalized = PlaneFromPixel(camera, xy);
  const Eigen::Vector2d dx(step, 0.0), dy(0.0, step);
  Eigen::Matrix2d jacobian;
  jacobian.col(0) = (PixelFromPlane(camera, normalized + dx) -
                     PixelFromPlane(camera, normalized - dx)) /
                    (2.0 * step);
  jacobian.col(1) = (PixelFromPlane(camera, normalized + dy) -
                     PixelFromPlane(camera, normalized - dy)) /
                    (2.0 * step);
  const Eigen::Vector2d error = PixelFromPlane(camera, normalized) - xy;
  if (!jacobian.allFinite() || !(error.norm() < kMaxUndistortionErrorPx)) {
    return false;
  }
  keypoint->normalized = normalized;
  keypoint->whitened_from_normalized = jacobian / sigma_px;
  return true;
}

std::unique_ptr<ceres::CostFunction> CreateCameraCost(
    const colmap::Camera& camera, const Eigen::Vector2d& xy, double sigma_px,
    const AdjustedPose* pose) {
  std::unique_ptr<ceres::CostFunction> cost;
  VisitCameraModel(ModelIdOf(camera), [&](auto model) {
    using Model = decltype(model);
    using Cost = CameraReprojectionCost<Model>;
    cost = std::make_unique<
        ceres::AutoDiffCostFunction<Cost, 2, 6, 3, Model::kNumParams>>(
        new Cost(xy, sigma_px, pose));
  });
  return cost;
}

}  // namespace adasfm
