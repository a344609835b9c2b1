// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"

#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "core/median.h"

namespace adasfm {
namespace {

// A point of two images has one degree of freedom, whose median says little.
constexpr size_t kMinTrackLength = 3;
constexpr size_t kMinNumPoints = 100;

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

}  // namespace

std::optional<double> EstimateKeypointSigma(
    const colmap::Reconstruction& reconstruction) {
  const std::map<image_t, Rigid3d> poses = CamsFromWorld(reconstruction);
  std::vector<double> variances;
  double num_dof_of_points = 0.0;
  for (const auto& [point_id, point] : reconstruction.Points3D()) {
    const size_t length = TrackOf(point).Length();
    const double num_dof = 2.0 * length - 3.0;
    if (length >= 2) num_dof_of_points += num_dof;
    if (length < kMinTrackLength) continue;
    double sum = 0.0;
    for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
      sum += SquaredError(reconstruction, poses.at(element.image_id), element,
                          XyzOf(point));
    }
    if (std::isfinite(sum)) {
      variances.push_back(sum / (num_dof * MedianOfChi2PerDof(num_dof)));
    }
  }
  const double num_dof_of_poses = 6.0 * reconstruction.NumRegImages();
  if (variances.size() < kMinNumPoints ||
      num_dof_of_poses >= 0.5 * num_dof_of_points) {
    return std::nullopt;
  }
  return std::sqrt(UpperMedian(&variances) /
                   (1.0 - num_dof_of_poses / num_dof_of_points));
}

}  // namespace adasfm
