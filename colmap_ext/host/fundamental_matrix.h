// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <estimators/fundamental_matrix.h>

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace adasfm {

// x2^T F x1 = 0 for at least eight matches (pixels), by linear least squares.
inline std::optional<Eigen::Matrix3d> EstimateFundamentalMatrix(
    const std::vector<Eigen::Vector2d>& points1,
    const std::vector<Eigen::Vector2d>& points2) {
  if (points1.size() < 8) return std::nullopt;
  const std::vector<Eigen::Matrix3d> models =
      colmap::FundamentalMatrixEightPointEstimator::Estimate(points1, points2);
  if (models.empty() || !models.front().allFinite()) return std::nullopt;
  return models.front();
}

}  // namespace adasfm
