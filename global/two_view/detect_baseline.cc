// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/detect_baseline.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/median.h"

namespace adasfm {
namespace {

// Of the absolute value of a normal variable, and of the length of two, in
// sigmas.
constexpr double kMedianOfAbsolute = 0.6745;
constexpr double kMedianOfLength = 1.1774;
// 1 sigma of the ratio of both medians, times the root of the number of
// matches.
constexpr double kRatioSigma = 1.37;

// How far the second keypoint is, in px, from where the rotation alone takes
// the first.
double DisplacementPx(const Bearing& bearing1, const Bearing& bearing2,
                      const Eigen::Matrix3d& rotation) {
  const Eigen::Matrix<double, 3, 2>& jacobian = bearing2.jacobian;
  return (jacobian.transpose() * jacobian)
      .ldlt()
      .solve(jacobian.transpose() *
             (bearing2.direction - rotation * bearing1.direction))
      .norm();
}

}  // namespace

bool DetectBaseline(const EdgeBearings& bearings,
                    const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation,
                    double keypoint_sigma_px) {
  const size_t count = bearings.bearings1.size();
  if (count == 0) return false;
  std::vector<double> distances;
  std::vector<double> displacements;
  for (size_t k = 0; k < count; ++k) {
    const Bearing& bearing1 = *bearings.bearings1[k];
    const Bearing& bearing2 = *bearings.bearings2[k];
    distances.push_back(std::abs(
        ComputeEpipolarResidual(bearing1, bearing2, rotation, translation)
            .distance_px));
    displacements.push_back(DisplacementPx(bearing1, bearing2, rotation));
  }
  const double sigma_px =
      std::max(keypoint_sigma_px, UpperMedian(&distances) / kMedianOfAbsolute);
  // Noise of both keypoints.
  const double expected_px = kMedianOfLength * std::sqrt(2.0) * sigma_px;
  const double tolerance =
      3.0 * kRatioSigma / std::sqrt(static_cast<double>(count));
  return UpperMedian(&displacements) > (1.0 + tolerance) * expected_px;
}

}  // namespace adasfm
