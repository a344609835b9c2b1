// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/test_by_odometry.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/so3.h"

namespace adasfm {
namespace {

double TestRotation(const LoopFilterOptions& options, const ChainMotion& motion,
                    const ViewGraphEdge& edge) {
  const Eigen::Vector3d error =
      LogSo3(edge.cam2_from_cam1.rotation *
             motion.cam2_from_cam1.rotation.conjugate());
  const double sigma =
      DegToRad(options.min_rotation_error_deg) / options.max_num_sigmas +
      edge.rotation_sigma_rad;
  const Eigen::Matrix3d covariance =
      motion.covariance.topLeftCorner<3, 3>() +
      sigma * sigma * Eigen::Matrix3d::Identity();
  return std::sqrt(error.dot(covariance.ldlt().solve(error)));
}

// A pair whose centres are one against the chain.
double TestCoincidence(const LoopFilterOptions& options,
                       const ChainMotion& motion) {
  const double floor_m = options.min_position_error_m / options.max_num_sigmas;
  const Eigen::Matrix3d covariance =
      motion.covariance.bottomRightCorner<3, 3>() +
      floor_m * floor_m * Eigen::Matrix3d::Identity();
  const Eigen::Vector3d& error = motion.cam2_from_cam1.translation;
  return std::sqrt(error.dot(covariance.ldlt().solve(error)));
}

// The pair's metric translation against the chain's, in camera 2's frame. The
// pair's own error: along its direction that of its length, across it that of
// its direction.
double TestPosition(const LoopFilterOptions& options, const ChainMotion& motion,
                    const EdgeLength& length, const ViewGraphEdge& edge) {
  const Eigen::Vector3d direction =
      edge.cam2_from_cam1.translation.normalized();
  const Eigen::Vector3d error =
      length.length * direction - motion.cam2_from_cam1.translation;
  const double floor_m = options.min_position_error_m / options.max_num_sigmas;
  const double along_m =
      length.length * (options.length_error_ratio / options.max_num_sigmas +
                       length.log_sigma) +
      floor_m;
  const double across_m =
      length.length *
          (DegToRad(options.min_direction_error_deg) / options.max_num_sigmas +
           edge.direction_sigma_rad) +
      floor_m;
  const Eigen::Matrix3d along = direction * direction.transpose();
  const Eigen::Matrix3d covariance =
      motion.covariance.bottomRightCorner<3, 3>() + along_m * along_m * along +
      across_m * across_m * (Eigen::Matrix3d::Identity() - along);
  return std::sqrt(error.dot(covariance.ldlt().solve(error)));
}

// A pair of unknown length: the length that fits the chain best is taken. It
// can refute the pair, which may lead elsewhere, but not confirm it.
double TestDirection(const LoopFilterOptions& options,
                     const ChainMotion& motion, const ViewGraphEdge& edge) {
  constexpr double kUnknownLogSigma = 10.0;
  const double length =
      std::max(0.0, motion.cam2_from_cam1.translation.dot(
                        edge.cam2_from_cam1.translation.normalized()));
  return TestPosition(options, motion, {length, kUnknownLogSigma}, edge);
}

OdometryVerdict Judge(const LoopFilterOptions& options,
                      const OdometryTest& test) {
  const double sigmas = std::max(test.rotation_sigmas, test.position_sigmas);
  if (sigmas > options.max_num_sigmas) return OdometryVerdict::kContradicts;
  // Without a position, look-alike places cannot be told from the same place.
  if (test.position_sigmas < 0.0) return OdometryVerdict::kOpen;
  return sigmas > 0.5 * options.max_num_sigmas ? OdometryVerdict::kOpen
                                               : OdometryVerdict::kAgrees;
}

}  // namespace

OdometryTest TestByOdometry(const LoopFilterOptions& options,
                            const OdometryChain& chain,
                            const std::optional<EdgeLength>& length,
                            const ViewGraphEdge& edge) {
  OdometryTest test;
  if (!edge.IsKept() || edge.source == EdgeSource::kSensor ||
      !edge.has_rotation ||
      !chain.IsConnected(edge.image_id1, edge.image_id2)) {
    return test;
  }
  const ChainMotion motion = chain.Motion(edge.image_id1, edge.image_id2);
  if (!motion.has_rotation) return test;
  std::tie(test.begin, test.end) =
      std::minmax(chain.Index(edge.image_id1), chain.Index(edge.image_id2));
  test.rotation_sigmas = TestRotation(options, motion, edge);
  if (motion.has_position && !edge.has_baseline) {
    test.position_sigmas = TestCoincidence(options, motion);
  } else if (motion.has_position && edge.has_translation &&
             length.has_value()) {
    test.position_sigmas = TestPosition(options, motion, *length, edge);
  } else if (motion.has_position && edge.has_translation) {
    const double sigmas = TestDirection(options, motion, edge);
    if (sigmas > options.max_num_sigmas) test.position_sigmas = sigmas;
  }
  test.verdict = Judge(options, test);
  return test;
}

}  // namespace adasfm
