// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/two_view.h"

#include <base/essential_matrix.h>
#include <estimators/fundamental_matrix.h>
#include <estimators/pose.h>
#include <estimators/two_view_geometry.h>
#include <util/random.h>

namespace adasfm {

static_assert(colmap::TwoViewGeometry::CALIBRATED == kCalibratedConfiguration,
              "the number that databases have");

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
  colmap::SetPRNGSeed(seed);
  Eigen::Vector4d qvec;
  Eigen::Vector3d tvec;
  if (colmap::EstimateRelativePose(ransac, points1, points2, &qvec, &tvec) ==
          0 ||
      !qvec.allFinite() || !tvec.allFinite() || tvec.norm() < 1e-9) {
    return std::nullopt;
  }
  return Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)),
                 tvec.normalized());
}

std::optional<Eigen::Matrix3d> EstimateFundamentalMatrix(
    const std::vector<Eigen::Vector2d>& points1,
    const std::vector<Eigen::Vector2d>& points2) {
  if (points1.size() < 8) return std::nullopt;
  const std::vector<Eigen::Matrix3d> models =
      colmap::FundamentalMatrixEightPointEstimator::Estimate(points1, points2);
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
