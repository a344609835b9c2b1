// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/lens_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/median.h"

namespace adasfm {
namespace {

constexpr size_t kMinTrackLength = 3;
constexpr size_t kNumRings = 8;
constexpr size_t kMinObservations = 100 * kNumRings;
// The median of the absolute value of a standard normal variable.
constexpr double kMedianOfNormal = 0.6745;
// Variance of a median over that of a mean.
constexpr double kMedianVariance = M_PI / 2.0;

// Residual of a keypoint, in its camera's image.
struct Residual {
  double radius_px = 0.0;
  double radial_px = 0.0;  // outwards
  double tangential_px = 0.0;
};

std::map<camera_t, std::vector<Residual>> CollectResiduals(
    const colmap::Reconstruction& reconstruction) {
  const std::map<image_t, Rigid3d> poses = CamsFromWorld(reconstruction);
  std::map<camera_t, std::vector<Residual>> residuals;
  for (const auto& [point_id, point] : reconstruction.Points3D()) {
    if (TrackOf(point).Length() < kMinTrackLength) continue;
    for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
      const colmap::Image& image = reconstruction.Image(element.image_id);
      const colmap::Camera& camera = reconstruction.Camera(image.CameraId());
      const Eigen::Vector3d in_cam = poses.at(element.image_id) * XyzOf(point);
      if (!(in_cam.z() > 0.0)) continue;
      const Eigen::Vector2d keypoint = XyOf(image.Point2D(element.point2D_idx));
      const Eigen::Vector2d error =
          keypoint - PixelFromPlane(camera, in_cam.hnormalized());
      const Eigen::Vector2d from_center =
          keypoint -
          Eigen::Vector2d(camera.PrincipalPointX(), camera.PrincipalPointY());
      const double radius_px = from_center.norm();
      if (!(radius_px > 0.0) || !error.allFinite()) continue;
      const Eigen::Vector2d outwards = from_center / radius_px;
      residuals[image.CameraId()].push_back(
          {radius_px, error.dot(outwards),
           error.dot(Eigen::Vector2d(-outwards.y(), outwards.x()))});
    }
  }
  return residuals;
}

LensError Measure(std::vector<Residual> residuals) {
  std::sort(residuals.begin(), residuals.end(),
            [](const Residual& a, const Residual& b) {
              return a.radius_px < b.radius_px;
            });
  std::vector<double> across;
  for (const Residual& residual : residuals) {
    across.push_back(std::abs(residual.tangential_px));
  }
  const double sigma_px = UpperMedian(&across) / kMedianOfNormal;
  double mean_square = 0.0;
  for (size_t ring = 0; ring < kNumRings; ++ring) {
    std::vector<double> radial;
    for (size_t i = ring * residuals.size() / kNumRings;
         i < (ring + 1) * residuals.size() / kNumRings; ++i) {
      radial.push_back(residuals[i].radial_px);
    }
    const double median = UpperMedian(&radial);
    mean_square += median * median / kNumRings;
  }
  LensError error;
  error.rms_px = std::sqrt(mean_square);
  if (sigma_px > 0.0) {
    error.ratio = std::sqrt(
        std::max(0.0, mean_square / (sigma_px * sigma_px) -
                          kMedianVariance * kNumRings / residuals.size()));
  }
  return error;
}

}  // namespace

std::map<camera_t, LensError> MeasureLensErrors(
    const colmap::Reconstruction& reconstruction) {
  std::map<camera_t, LensError> errors;
  for (auto& [camera_id, residuals] : CollectResiduals(reconstruction)) {
    if (residuals.size() < kMinObservations) continue;
    errors[camera_id] = Measure(std::move(residuals));
  }
  return errors;
}

}  // namespace adasfm
