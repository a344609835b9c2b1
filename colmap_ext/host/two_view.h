// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/rigid3d.h"

namespace adasfm {

// Two-view geometry by the host's estimators, whose signatures differ between
// its versions.

// COLMAP's number of a verified pair of calibrated cameras.
inline constexpr int kCalibratedConfiguration = 2;

// Whether this configuration (TwoViewGeometry::ConfigurationType) means a
// verified pair.
bool IsVerifiedConfiguration(int config);

// Estimates cam2_from_cam1, with a unit translation, from points on the
// normalised image planes, by the five-point algorithm and RANSAC with this
// seed. max_error: largest distance of an inlier on those planes. None on
// failure, and for a pose that is not finite.
std::optional<Rigid3d> EstimateRelativePose(
    const std::vector<Eigen::Vector2d>& points1,
    const std::vector<Eigen::Vector2d>& points2, double max_error,
    uint32_t seed);

// x2^T F x1 = 0 for at least eight matches (pixels), by linear least squares.
std::optional<Eigen::Matrix3d> EstimateFundamentalMatrix(
    const std::vector<Eigen::Vector2d>& points1,
    const std::vector<Eigen::Vector2d>& points2);

// The two rotations and the direction, up to its sign, of an essential matrix.
struct EssentialPoses {
  Eigen::Matrix3d rotations[2];
  Eigen::Vector3d translation;
};
EssentialPoses DecomposeEssentialMatrix(
    const Eigen::Matrix3d& essential_matrix);

}  // namespace adasfm
