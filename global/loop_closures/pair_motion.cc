// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/pair_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "global/odometry/uncertain_motion.h"

namespace adasfm {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Translation = PairMotion::Translation;

ChiSquare ComputeChiSquare(const Vector6d& error, const Matrix6d& covariance,
                           int dof) {
  ChiSquare chi_square;
  chi_square.dof = dof;
  if (dof == 3) {
    const Eigen::Vector3d rotation = error.head<3>();
    chi_square.value =
        rotation.dot(covariance.topLeftCorner<3, 3>().ldlt().solve(rotation));
  } else {
    chi_square.value = error.dot(covariance.ldlt().solve(error));
  }
  return chi_square;
}

}  // namespace

// By the recurrence of the regularised upper gamma function.
double ChiSquare::Probability() const {
  if (dof <= 0) return 1.0;
  const double half = 0.5 * std::max(0.0, value);
  double shape = dof % 2 == 0 ? 1.0 : 0.5;
  double probability =
      dof % 2 == 0 ? std::exp(-half) : std::erfc(std::sqrt(half));
  for (; shape < 0.5 * dof - 0.25; shape += 1.0) {
    probability += std::exp(shape * std::log(std::max(half, 1e-300)) - half -
                            std::lgamma(shape + 1.0));
  }
  return probability;
}

PairMotion PairMotion::Inverse() const {
  return {motion.Inverse(), translation};
}

PairMotion MeasurePair(const ViewGraphEdge& edge,
                       const std::optional<EdgeLength>& length, double unit) {
  // 1 sigma of a position, as a ratio of `unit`; closer centres look like one.
  constexpr double kPositionSigmaRatio = 0.06;
  const double floor = kPositionSigmaRatio * unit;
  const double angle = DegToRad(kPairAngleSigmaDeg);
  PairMotion pair;
  pair.motion.cam2_from_cam1.rotation = edge.cam2_from_cam1.rotation;
  const double rotation_sigma = std::hypot(edge.rotation_sigma_rad, angle);
  pair.motion.covariance.topLeftCorner<3, 3>() =
      rotation_sigma * rotation_sigma * Eigen::Matrix3d::Identity();
  auto translation_covariance =
      pair.motion.covariance.bottomRightCorner<3, 3>();
  // Without a baseline the direction means nothing.
  if (!edge.has_translation || !edge.has_baseline) return pair;
  const Eigen::Vector3d direction =
      edge.cam2_from_cam1.translation.normalized();
  const double across = std::hypot(edge.direction_sigma_rad, angle);
  if (!length.has_value()) {
    pair.translation = Translation::kDirection;
    pair.motion.cam2_from_cam1.translation = direction;
    translation_covariance = CovarianceAlong(direction, 0.0, across);
    return pair;
  }
  pair.translation = Translation::kFull;
  pair.motion.cam2_from_cam1.translation = length->length * direction;
  translation_covariance = CovarianceAlong(
      direction,
      std::hypot(
          length->length * std::hypot(kPairLengthLogSigma, length->log_sigma),
          floor),
      std::hypot(length->length * across, floor));
  return pair;
}

ChiSquare TestPair(const PairMotion& pair, const UncertainMotion& predicted,
                   bool has_position) {
  Vector6d error;
  error.head<3>() = LogSo3(pair.motion.cam2_from_cam1.rotation *
                           predicted.cam2_from_cam1.rotation.conjugate());
  Matrix6d covariance = pair.motion.covariance;
  if (!has_position || pair.translation == Translation::kNone) {
    covariance += predicted.covariance;
    return ComputeChiSquare(error, covariance, 3);
  }
  Eigen::Vector3d translation = pair.motion.cam2_from_cam1.translation;
  const Eigen::Vector3d& expected = predicted.cam2_from_cam1.translation;
  int dof = 6;
  if (pair.translation == Translation::kDirection) {
    const Eigen::Vector3d direction = translation;
    const double length = std::max(0.0, direction.dot(expected));
    translation *= length;
    covariance.bottomRows<3>() *= length;
    covariance.rightCols<3>() *= length;
    // No positive length fits a pair that points away.
    if (length > 0.0) {
      dof = 5;
      const double unknown = 1e3 * length;
      covariance.bottomRightCorner<3, 3>() +=
          unknown * unknown * direction * direction.transpose();
    }
  }
  error.tail<3>() = translation - expected;
  covariance += predicted.covariance;
  return ComputeChiSquare(error, covariance, dof);
}

ChiSquare TestByOdometry(const OdometryChain& chain, const ViewGraphEdge& edge,
                         const PairMotion& pair) {
  if (!chain.IsConnected(edge.image_id1, edge.image_id2)) return ChiSquare();
  const ChainMotion motion = chain.Motion(edge.image_id1, edge.image_id2);
  if (!motion.has_rotation) return ChiSquare();
  return TestPair(pair, {motion.cam2_from_cam1, motion.covariance},
                  motion.has_position);
}

}  // namespace adasfm
