// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/two_view.h"

#include <colmap/estimators/pose.h>
#include <colmap/estimators/solvers/fundamental_matrix.h>
#include <colmap/geometry/essential_matrix.h>
#include <colmap/scene/two_view_geometry.h>

namespace adasfm {
namespace {

static_assert(colmap::TwoViewGeometry::CALIBRATED == kCalibratedConfiguration,
              "the number that databases have");

// The rays of points on the plane z = 1, with derivatives by the points, so
// that errors are lengths on that plane.
std::vector<colmap::CamRayWithJac> RaysOf(
    const std::vector<Eigen::Vector2d>& points) {
  std::vector<colmap::CamRayWithJac> rays;
  rays.reserve(points.size());
  for (const Eigen::Vector2d& point : points) {
    const double norm = point.homogeneous().norm();
    colmap::CamRayWithJac ray;
    ray.ray = point.homogeneous() / norm;
    ray.jacobian =
        ((Eigen::Matrix3d::Identity() - ray.ray * ray.ray.transpose()) / norm)
            .leftCols<2>();
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace

bool IsVerifiedConfiguration(int config) {
  return config != colmap::TwoViewGeometry::UNDEFINED &&
         config != colmap::TwoViewGeometry::DEGENERATE &&
         config != colmap::TwoViewGeometry::WATERMARK;
}

std::optional<Rigid3d> EstimateRelativePose(
    const std::vector<Eigen::Vector2d>& points1,
    const std::vector<Eigen::Vector2d>& points2, double max_error,
    uint32_t seed) {
  colmap::RANSACOptions ransac;
  ransac.max_error = max_error;
  ransac.min_inlier_ratio = 0.3;
  ransac.max_num_trials = 1000;
  ransac.confidence = 0.999;
  ransac.random_seed = static_cast<int>(seed & 0x7fffffffu);
  colmap::Rigid3d pose;
  size_t num_inliers = 0;
  std::vector<char> inlier_mask;
  if (!colmap::EstimateRelativePose(ransac, RaysOf(points1), RaysOf(points2),
                                    &pose, &num_inliers, &inlier_mask) ||
      !pose.params.allFinite() || pose.translation().norm() < 1e-9) {
    return std::nullopt;
  }
  return Rigid3d(Eigen::Quaterniond(pose.rotation()),
                 pose.translation().normalized());
}

std::optional<Eigen::Matrix3d> EstimateFundamentalMatrix(
    const std::vector<Eigen::Vector2d>& points1,
    const std::vector<Eigen::Vector2d>& points2) {
  if (points1.size() < 8) return std::nullopt;
  std::vector<Eigen::Matrix3d> models;
  colmap::FundamentalMatrixEightPointEstimator::Estimate(points1, points2,
                                                         &models);
  if (models.empty() || !models.front().allFinite()) return std::nullopt;
  return models.front();
}

EssentialPoses DecomposeEssentialMatrix(
    const Eigen::Matrix3d& essential_matrix) {
  EssentialPoses poses;
  colmap::DecomposeEssentialMatrix(essential_matrix, &poses.rotations[0],
                                   &poses.rotations[1], &poses.translation);
  return poses;
}

}  // namespace adasfm
