// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "core/median.h"

namespace adasfm {
namespace {

// A point of two images has one degree of freedom; its median is of little use.
constexpr size_t kMinTrackLength = 3;
constexpr size_t kMinNumPoints = 100;
// 0.03 % of correct observations err by more.
constexpr double kMaxErrorPerSigma = 4.0;

// The median of chi-square with k degrees of freedom over k.
double MedianOfChi2PerDof(double num_dof) {
  const double root = 1.0 - 2.0 / (9.0 * num_dof);
  return root * root * root;
}

// Infinite for a point behind the camera.
double SquaredError(const colmap::Reconstruction& reconstruction,
                    const Rigid3d& cam_from_world,
                    const colmap::TrackElement& element,
                    const Eigen::Vector3d& point) {
  const colmap::Image& image = reconstruction.Image(element.image_id);
  const Eigen::Vector3d in_cam = cam_from_world * point;
  if (!(in_cam.z() > 0.0)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector2d projected = PixelFromPlane(
      reconstruction.Camera(image.CameraId()), in_cam.hnormalized());
  return (projected - XyOf(image.Point2D(element.point2D_idx))).squaredNorm();
}

// The data for the sigma of one camera, or of all.
struct Residuals {
  // An estimate of sigma^2 from each point.
  std::vector<double> variances;
  double num_dof_of_observations = 0.0;
  size_t num_images = 0;

  std::optional<double> Sigma() {
    const double num_dof_of_poses = 6.0 * num_images;
    if (variances.size() < kMinNumPoints ||
        num_dof_of_poses >= 0.5 * num_dof_of_observations) {
      return std::nullopt;
    }
    return std::sqrt(UpperMedian(&variances) /
                     (1.0 - num_dof_of_poses / num_dof_of_observations));
  }
};

// None for a point behind an image, or with fewer than three images.
std::optional<double> EstimateVariance(
    const colmap::Reconstruction& reconstruction,
    const std::map<image_t, Rigid3d>& poses, const colmap::Point3D& point) {
  const size_t length = TrackOf(point).Length();
  if (length < kMinTrackLength) return std::nullopt;
  const double num_dof = 2.0 * length - 3.0;
  double sum = 0.0;
  for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
    sum += SquaredError(reconstruction, poses.at(element.image_id), element,
                        XyzOf(point));
  }
  if (!std::isfinite(sum)) return std::nullopt;
  return sum / (num_dof * MedianOfChi2PerDof(num_dof));
}

}  // namespace

KeypointSigmas EstimateKeypointSigmas(
    const colmap::Reconstruction& reconstruction) {
  const std::map<image_t, Rigid3d> poses = CamsFromWorld(reconstruction);
  Residuals of_all;
  std::map<camera_t, Residuals> of_cameras;
  for (const auto& [image_id, pose] : poses) {
    ++of_all.num_images;
    ++of_cameras[reconstruction.Image(image_id).CameraId()].num_images;
  }
  for (const auto& [point_id, point] : reconstruction.Points3D()) {
    const size_t length = TrackOf(point).Length();
    if (length < 2) continue;
    of_all.num_dof_of_observations += 2.0 * length - 3.0;
    std::set<camera_t> cameras;
    for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
      const camera_t camera_id =
          reconstruction.Image(element.image_id).CameraId();
      cameras.insert(camera_id);
      of_cameras.at(camera_id).num_dof_of_observations += 2.0 - 3.0 / length;
    }
    const auto variance = EstimateVariance(reconstruction, poses, point);
    if (!variance) continue;
    of_all.variances.push_back(*variance);
    if (cameras.size() == 1) {
      of_cameras.at(*cameras.begin()).variances.push_back(*variance);
    }
  }
  KeypointSigmas sigmas;
  sigmas.of_all_px = of_all.Sigma();
  if (reconstruction.NumCameras() < 2) return sigmas;
  for (auto& [camera_id, of_camera] : of_cameras) {
    const std::optional<double> sigma_px = of_camera.Sigma();
    if (sigma_px) sigmas.of_cameras_px[camera_id] = *sigma_px;
  }
  return sigmas;
}

double MaxReprojErrorPx(double min_error_px,
                        const colmap::Reconstruction& reconstruction) {
  const KeypointSigmas sigmas = EstimateKeypointSigmas(reconstruction);
  return std::max(min_error_px,
                  kMaxErrorPerSigma * sigmas.of_all_px.value_or(0.0));
}

}  // namespace adasfm
