// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/detect_baseline.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// In sigmas: of the absolute value of a normal variable, and of the length of a
// vector of two.
constexpr double kMedianOfAbsolute = 0.6745;
constexpr double kMedianOfLength = 1.1774;
// 1 sigma of the ratio of both medians, times the root of the number of
// matches.
constexpr double kRatioSigma = 1.37;

// The median distance of the second keypoints, in px, from the first ones moved
// by the rotation alone. improved: a better rotation.
double MedianDisplacementPx(const EdgeBearings& bearings,
                            const Eigen::Matrix3d& rotation,
                            Eigen::Matrix3d* improved) {
  // Finer than any keypoint.
  constexpr double kMinPx = 0.1;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
  std::vector<double> displacements;
  for (size_t k = 0; k < bearings.bearings1.size(); ++k) {
    const Eigen::Matrix<double, 3, 2>& by_pixel =
        bearings.bearings2[k]->jacobian;
    const Eigen::Vector3d turned = rotation * bearings.bearings1[k]->direction;
    const Eigen::Matrix<double, 2, 3> to_pixel =
        (by_pixel.transpose() * by_pixel).inverse() * by_pixel.transpose();
    const Eigen::Vector2d displacement =
        to_pixel * (bearings.bearings2[k]->direction - turned);
    const Eigen::Matrix<double, 2, 3> jacobian = to_pixel * Hat(turned);
    displacements.push_back(displacement.norm());
    // Sum of distances, by reweighted squares: up to half may be outliers.
    const double weight = 1.0 / std::max(kMinPx, displacements.back());
    matrix += weight * jacobian.transpose() * jacobian;
    right_side -= weight * jacobian.transpose() * displacement;
  }
  const Eigen::Vector3d turn = matrix.ldlt().solve(right_side);
  *improved = turn.allFinite()
                  ? Eigen::Matrix3d(ExpSo3(turn).toRotationMatrix() * rotation)
                  : rotation;
  return UpperMedian(&displacements);
}

}  // namespace

bool DetectBaseline(const EdgeBearings& bearings,
                    const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation,
                    double keypoint_sigma_px) {
  const size_t count = bearings.bearings1.size();
  if (count == 0) return false;
  std::vector<double> distances;
  for (size_t k = 0; k < count; ++k) {
    distances.push_back(std::abs(ComputeEpipolarResidual(*bearings.bearings1[k],
                                                         *bearings.bearings2[k],
                                                         rotation, translation)
                                     .distance_px));
  }
  const double sigma_px =
      std::max(keypoint_sigma_px, UpperMedian(&distances) / kMedianOfAbsolute);
  // Noise of both keypoints.
  const double expected_px = kMedianOfLength * std::sqrt(2.0) * sigma_px;
  const double tolerance =
      3.0 * kRatioSigma / std::sqrt(static_cast<double>(count));
  // Without a baseline, rotations along the epipolar lines cost nothing, so the
  // given one may be any of them.
  constexpr int kMaxNumTurns = 3;
  Eigen::Matrix3d turned = rotation;
  double last_px = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kMaxNumTurns; ++i) {
    const double median_px = MedianDisplacementPx(bearings, turned, &turned);
    if (median_px <= (1.0 + tolerance) * expected_px) return false;
    if (median_px > 0.7 * last_px) break;
    last_px = median_px;
  }
  return true;
}

}  // namespace adasfm
