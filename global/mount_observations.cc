// SPDX-License-Identifier: BSD-3-Clause
#include "global/mount_observations.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "global/translation_direction.h"

namespace adasfm {
namespace {

using Matrix5d = Eigen::Matrix<double, 5, 5>;
using Jacobian = Eigen::Matrix<double, 3, kNumMountUnknowns>;

constexpr double kLossScalePx = 1.5;
constexpr double kKeypointSigmaPx = 0.5;
// Least error granted to a rotation, of vision or sensors.
constexpr double kMinRotationSigmaRad = 5e-4;
// Sensors know the direction of longer motions only.
constexpr double kMinLengthM = 0.05;
// Directions farther from the sensors' are not theirs.
constexpr double kMaxDirectionErrorRad = 0.5;

// The motion of a pair with its priors turned.
struct TurnedMotion {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d direction;
  // Of the rotation, and of the direction as a vector.
  Eigen::Matrix3d rotation_covariance;
  Eigen::Matrix3d direction_covariance;
  // Changes of the rotation (from the left) by all unknowns, as vision sees it
  // from the sensors' but without vision's own offset.
  Jacobian rotation_change = Jacobian::Zero();
  bool has_direction = false;
};

TurnedMotion TurnMotion(const ChainMotion& motion,
                        const Eigen::Quaterniond& turn, double seconds) {
  TurnedMotion turned;
  const Eigen::Matrix3d matrix = turn.toRotationMatrix();
  const Eigen::Quaterniond rotation =
      turn * motion.cam2_from_cam1.rotation * turn.conjugate();
  turned.rotation = rotation.toRotationMatrix();
  turned.rotation_covariance =
      matrix * motion.covariance.topLeftCorner<3, 3>() * matrix.transpose();
  turned.rotation_covariance.diagonal().array() +=
      kMinRotationSigmaRad * kMinRotationSigmaRad;
  // Exp(e) R Exp(-e) R^T = Exp((I - R) e); the mean turn of the frames in
  // between is good enough for a few steps.
  turned.rotation_change.leftCols<3>() =
      Eigen::Matrix3d::Identity() - turned.rotation;
  turned.rotation_change.middleCols<3>(3) =
      seconds * ExpSo3(0.5 * LogSo3(rotation)).toRotationMatrix();
  const Eigen::Vector3d& translation = motion.cam2_from_cam1.translation;
  const double length = translation.norm();
  turned.has_direction = motion.has_position && length > kMinLengthM;
  if (!turned.has_direction) return turned;
  turned.direction = matrix * translation / length;
  turned.direction_covariance = matrix *
                                motion.covariance.bottomRightCorner<3, 3>() *
                                matrix.transpose() / (length * length);
  return turned;
}

// Whitens `residual = jacobian * unknowns` of the first kRows rows.
template <int kRows>
MountObservation Whiten(
    const MountPair& pair,
    const Eigen::Matrix<double, kRows, kNumMountUnknowns>& jacobian,
    const Eigen::Matrix<double, kRows, 1>& residual,
    const Eigen::Matrix<double, kRows, kRows>& covariance) {
  const Eigen::LLT<Eigen::Matrix<double, kRows, kRows>> root(covariance);
  MountObservation observation;
  observation.jacobian.setZero();
  observation.residual.setZero();
  observation.jacobian.template topRows<kRows>() =
      root.matrixL().solve(jacobian);
  observation.residual.template head<kRows>() = root.matrixL().solve(residual);
  observation.weight = 1.0 / pair.num_steps;
  observation.span = pair.span;
  return observation;
}

MountObservation ObserveRotation(const MountPair& pair,
                                 const TurnedMotion& motion) {
  Jacobian jacobian = motion.rotation_change;
  jacobian.rightCols<3>().setIdentity();
  const Eigen::Vector3d residual = LogSo3(
      pair.last_from_first * Eigen::Quaterniond(motion.rotation).conjugate());
  const double sigma = std::max(kMinRotationSigmaRad, pair.rotation_sigma_rad);
  return Whiten<3>(
      pair, jacobian, residual,
      motion.rotation_covariance + sigma * sigma * Eigen::Matrix3d::Identity());
}

// The normal matrix of the matches' distances by (rotation, direction), in
// units of the noise's variance.
Matrix5d ComputeInformation(const TranslationProblem& problem,
                            const Eigen::Vector3d& direction,
                            const Eigen::Matrix<double, 3, 2>& basis) {
  Matrix5d matrix = Matrix5d::Zero();
  double sum_weights = 0.0;
  double sum_weighted_squares = 0.0;
  const EdgeBearings& bearings = problem.bearings;
  for (size_t k = 0; k < bearings.bearings1.size(); ++k) {
    const EpipolarResidual residual =
        ComputeEpipolarResidual(*bearings.bearings1[k], *bearings.bearings2[k],
                                problem.rotation, direction);
    const double squared = residual.distance_px * residual.distance_px;
    const double weight = 1.0 / (1.0 + squared / (kLossScalePx * kLossScalePx));
    const Eigen::Matrix<double, 5, 1> jacobian = EpipolarJacobian(
        *bearings.bearings1[k], *bearings.bearings2[k], problem.rotation,
        direction, basis, residual.inverse_norm);
    matrix.noalias() += weight * jacobian * jacobian.transpose();
    sum_weights += weight;
    sum_weighted_squares += weight * squared;
  }
  return matrix /
         std::max(kKeypointSigmaPx * kKeypointSigmaPx,
                  sum_weighted_squares / std::max(1.0, sum_weights - 2.0));
}

}  // namespace

std::vector<MountObservation> ObserveMount(const OdometryChain& chain,
                                           const Eigen::Quaterniond& turn,
                                           const MountPair& pair) {
  std::vector<MountObservation> observations;
  const TurnedMotion motion =
      TurnMotion(chain.Motion(pair.first, pair.last), turn, pair.seconds);
  observations.push_back(ObserveRotation(pair, motion));
  if (!motion.has_direction) return observations;

  DirectionSearch search;
  search.loss_scale_px = kLossScalePx;
  search.search = false;
  search.max_num_iterations = 8;
  const TranslationProblem problem =
      BuildTranslationProblem(pair.bearings, motion.rotation);
  const Eigen::Vector3d direction =
      EstimateTranslationDirection(search, problem, motion.direction).direction;
  if (!(AngleBetweenRad(direction, motion.direction) < kMaxDirectionErrorRad) ||
      !(direction.norm() > 0.5)) {
    return observations;
  }
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(motion.direction);
  const Matrix5d information = ComputeInformation(problem, direction, basis);
  const Eigen::LLT<Eigen::Matrix2d> solver(
      information.bottomRightCorner<2, 2>());
  const Eigen::Matrix2d by_matches = solver.solve(Eigen::Matrix2d::Identity());
  if (solver.info() != Eigen::Success || !by_matches.allFinite()) {
    return observations;
  }
  // How the direction of least distances moves with the rotation that is held;
  // it is held at the sensors', which is off by minus the change.
  const Eigen::Matrix<double, 2, 3> by_rotation =
      solver.solve(information.bottomLeftCorner<2, 3>());
  Eigen::Matrix<double, 2, kNumMountUnknowns> jacobian =
      by_rotation * motion.rotation_change;
  jacobian.leftCols<3>() -= basis.transpose() * Hat(motion.direction);
  observations.push_back(Whiten<2>(
      pair, jacobian, basis.transpose() * direction,
      by_matches +
          by_rotation * motion.rotation_covariance * by_rotation.transpose() +
          basis.transpose() * motion.direction_covariance * basis));
  return observations;
}

}  // namespace adasfm
