// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/minimize_epipolar_distances.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector5d = Eigen::Matrix<double, 5, 1>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Projection = Eigen::Matrix<double, 6, 5>;

struct NormalEquations {
  Matrix6d matrix = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double cost = 0.0;
};

// Gauss-Newton terms by (rotation, translation).
NormalEquations Accumulate(const EpipolarMinimization& options,
                           const EdgeBearings& bearings,
                           const TwoViewPose& pose) {
  const double squared_scale = options.loss_scale_px * options.loss_scale_px;
  NormalEquations sums;
  for (size_t k = 0; k < bearings.bearings1.size(); ++k) {
    const EpipolarTerm term = LinearizeEpipolarDistance(
        *bearings.bearings1[k], *bearings.bearings2[k], pose.rotation,
        pose.translation);
    const double ratio = term.distance_px * term.distance_px / squared_scale;
    const double weight = 1.0 / (1.0 + ratio);
    sums.matrix.noalias() += weight * term.jacobian * term.jacobian.transpose();
    sums.gradient += weight * term.distance_px * term.jacobian;
    sums.cost += squared_scale * std::log1p(ratio);
  }
  const WeightedPrediction& prediction = options.prediction;
  const Eigen::Vector3d error = LogSo3(Eigen::Quaterniond(
      Eigen::Matrix3d(pose.rotation * prediction.rotation.transpose())));
  sums.matrix.topLeftCorner<3, 3>() += prediction.information;
  sums.gradient.head<3>() += prediction.information * error;
  sums.cost += error.dot(prediction.information * error);
  return sums;
}

Projection TangentProjection(const Eigen::Matrix<double, 3, 2>& basis) {
  Projection projection = Projection::Zero();
  projection.topLeftCorner<3, 3>().setIdentity();
  projection.bottomRightCorner<3, 2>() = basis;
  return projection;
}

TwoViewPose Move(const TwoViewPose& pose, const Vector6d& step) {
  TwoViewPose moved;
  moved.rotation = ExpSo3(step.head<3>()).toRotationMatrix() * pose.rotation;
  moved.translation = (pose.translation + step.tail<3>()).normalized();
  return moved;
}

Vector6d ComputeStep(const NormalEquations& sums, bool hold_rotation,
                     double damping, const Eigen::Vector3d& translation) {
  const Projection projection = TangentProjection(TangentBasis(translation));
  Matrix5d matrix = projection.transpose() * sums.matrix * projection;
  Vector5d gradient = projection.transpose() * sums.gradient;
  if (hold_rotation) {
    matrix.topRows<3>().setZero();
    matrix.leftCols<3>().setZero();
    matrix.topLeftCorner<3, 3>().setIdentity();
    gradient.head<3>().setZero();
  }
  matrix.diagonal() *= 1.0 + damping;
  matrix.diagonal().array() += 1e-9 * matrix.trace();
  return -projection * matrix.ldlt().solve(gradient);
}

// mean(psi^2) / mean(psi') of normal noise. With a = sigma / scale,
// E[w] = E[1 / (1 + a^2 z^2)] has a closed form, and the others follow from it.
double NormalCostVariance(double sigma_px, double loss_scale_px) {
  const double inverse = loss_scale_px / (std::sqrt(2.0) * sigma_px);
  // Beyond, the loss cuts off nothing (and exp would overflow).
  if (inverse > 20.0) return sigma_px * sigma_px;
  const double weight = std::sqrt(M_PI) * inverse *
                        std::exp(inverse * inverse) * std::erfc(inverse);
  const double slope = 2.0 * inverse * inverse * (1.0 - weight);
  const double squared_weight = 0.5 * (slope + weight);
  return loss_scale_px * loss_scale_px * (weight - squared_weight) / slope;
}

struct LossSums {
  Matrix6d matrix = Matrix6d::Zero();  // of w J J^T
  double weights = 1e-9;
  double squares = 0.0;  // of psi
  double slopes = 0.0;   // of psi'
};

LossSums AccumulateLoss(double loss_scale_px, const EdgeBearings& bearings,
                        const TwoViewPose& pose) {
  // Where nearly all matches are far off, their slopes mean nothing.
  constexpr double kMinSlope = 0.1;
  LossSums sums;
  for (size_t k = 0; k < bearings.bearings1.size(); ++k) {
    const EpipolarTerm term = LinearizeEpipolarDistance(
        *bearings.bearings1[k], *bearings.bearings2[k], pose.rotation,
        pose.translation);
    const double ratio = std::pow(term.distance_px / loss_scale_px, 2);
    const double weight = 1.0 / (1.0 + ratio);
    sums.matrix.noalias() += weight * term.jacobian * term.jacobian.transpose();
    sums.weights += weight;
    sums.squares += std::pow(weight * term.distance_px, 2);
    sums.slopes += (1.0 - ratio) * weight * weight;
  }
  sums.slopes = std::max(sums.slopes, kMinSlope * sums.weights);
  return sums;
}

}  // namespace

EpipolarMinimum MinimizeEpipolarDistances(const EpipolarMinimization& options,
                                          const EdgeBearings& bearings,
                                          const TwoViewPose& start) {
  constexpr double kSmallDecrease = 1e-5;
  EpipolarMinimum best;
  best.pose = start;
  NormalEquations sums = Accumulate(options, bearings, start);
  double damping = 1e-4;
  for (int i = 0; i < options.max_num_iterations; ++i) {
    const Vector6d step = ComputeStep(sums, options.hold_rotation, damping,
                                      best.pose.translation);
    if (!step.allFinite()) break;
    const TwoViewPose next = Move(best.pose, step);
    const NormalEquations next_sums = Accumulate(options, bearings, next);
    if (next_sums.cost <= sums.cost) {
      const bool is_done =
          sums.cost - next_sums.cost < kSmallDecrease * sums.cost;
      best.pose = next;
      sums = next_sums;
      damping = std::max(1e-9, 0.1 * damping);
      if (is_done) break;
    } else {
      damping = std::max(1e-3, 10.0 * damping);
    }
  }
  best.cost = sums.cost;
  return best;
}

EpipolarInformation ComputeEpipolarInformation(const EpipolarNoise& noise,
                                               const EdgeBearings& bearings,
                                               const TwoViewPose& pose) {
  const LossSums sums = AccumulateLoss(noise.loss_scale_px, bearings, pose);
  const double slope = sums.slopes / sums.weights;
  EpipolarInformation information;
  information.basis = TangentBasis(pose.translation);
  information.cost_variance =
      std::max(NormalCostVariance(kMinKeypointSigmaPx, noise.loss_scale_px),
               sums.squares / sums.slopes * sums.weights /
                   std::max(1.0, sums.weights - noise.num_unknowns));
  const Projection projection = TangentProjection(information.basis);
  information.matrix = slope / information.cost_variance *
                       (projection.transpose() * sums.matrix * projection);
  return information;
}

}  // namespace adasfm
