// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/fusion_covariances.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "sensors/smoother/noise_checks.h"
#include "sensors/smoother/shared_uncertainty.h"

namespace adasfm {
namespace {

using Shared = SharedUncertainty;

// Tilt rate that all links may share: a machine stays upright.
constexpr double kTiltRateSigma = 1e-4;  // rad/s

// Sums over the marginals of the links.
struct Marginals {
  Shared shared;
  NoiseChecks noise;
  // Change of each link's motion for one sigma of each shared coordinate.
  std::vector<Eigen::Matrix<double, 6, Shared::kSize>> by_shared;
  // Of the globals, the same in every link.
  double length_variance = 0.0, delay_variance = 0.0;
  Eigen::Matrix2d wheel_yaw_covariance = Eigen::Matrix2d::Zero();
  Eigen::Array2d driving_variance = Eigen::Array2d::Zero();
};

// The motion over a link, without its covariance.
OdometryMotion Motion(const ChainProblem& chain, size_t k) {
  OdometryMotion motion;
  const Eigen::Quaterniond r21 =
      chain.states[k + 1].state.world_from_imu.conjugate() *
      chain.states[k].state.world_from_imu;
  motion.body2_from_body1 =
      Rigid3d(r21, r21 * -chain.states[k + 1].step_in_previous);
  motion.wheel_weight = chain.wheel_weights[k];
  return motion;
}

// The derivative of Motion by the coordinates of the link.
Eigen::Matrix<double, 6, kLinkSize> MotionMap(const ChainProblem& chain,
                                              size_t k) {
  const Eigen::Matrix3d r2_transposed =
      chain.states[k + 1].state.world_from_imu.toRotationMatrix().transpose();
  const Eigen::Quaterniond r21 =
      chain.states[k + 1].state.world_from_imu.conjugate() *
      chain.states[k].state.world_from_imu;
  // dtheta = R2^T (d1 - d2), dt = [R21 u]x dtheta - R21 du.
  Eigen::Matrix<double, 6, kLinkSize> map;
  map.setZero();
  map.block<3, 3>(0, ChainState::kRotation) = r2_transposed;
  map.block<3, 3>(0, ChainState::kSize + ChainState::kRotation) =
      -r2_transposed;
  map.bottomRows<3>() =
      Hat(r21 * chain.states[k + 1].step_in_previous) * map.topRows<3>();
  map.block<3, 3>(3, ChainState::kSize + ChainState::kStep) -=
      r21.toRotationMatrix();
  return map;
}

Marginals CollectMarginals(const ChainProblem& chain,
                           OdometryFusionResult* result) {
  constexpr int kDriving = 2 * ChainState::kSize + ChainGlobals::kDrivingYaw;
  constexpr int kYaw = 2 * ChainState::kSize + ChainGlobals::kLoggedYaw;
  constexpr int kDelay = 2 * ChainState::kSize + ChainGlobals::kWheelDelay;
  const size_t num_links = chain.NumLinks();
  Marginals sums;
  sums.by_shared.resize(num_links);
  double accel_variance = 0.0;
  ComputeChainCovariances(
      num_links, chain.FirstMessage(),
      [&](size_t k) { return chain.Equations(k); },
      [&](size_t k, const LinkCovariance& covariance) {
        const LinkResiduals residuals = chain.Residuals(k);
        sums.noise.Add(chain, k, residuals, covariance);
        sums.shared.Add(chain.problem.links[k].dt_s, residuals, covariance);
        const Eigen::Matrix<double, 6, kLinkSize> map = MotionMap(chain, k);
        result->motions[k] = Motion(chain, k);
        result->motions[k].covariance = map * covariance * map.transpose();
        for (int i = 0; i < Shared::kSize; ++i) {
          const int column = Shared::Column(i);
          sums.by_shared[k].col(i) = map * covariance.col(column) /
                                     std::sqrt(covariance(column, column));
        }
        result->gyroscope_bias_covariance +=
            covariance.block<3, 3>(ChainState::kGyro, ChainState::kGyro) /
            num_links;
        accel_variance +=
            covariance.diagonal().segment<3>(ChainState::kAccel).mean();
        sums.length_variance = covariance(Shared::Column(Shared::kScale),
                                          Shared::Column(Shared::kScale));
        sums.wheel_yaw_covariance = covariance.block<2, 2>(kYaw, kYaw);
        sums.driving_variance = covariance.diagonal().segment<2>(kDriving);
        sums.delay_variance = covariance(kDelay, kDelay);
      });
  result->accelerometer_bias_sigma = std::sqrt(accel_variance / num_links);
  return sums;
}

// Covariance of the rate error that the errors of track and curvature cause in
// all links: the mean over the links; zero where no wheels observe the yaw.
Eigen::Matrix3d WheelYawRateCovariance(
    const ChainProblem& chain, const Eigen::Matrix2d& wheel_yaw_covariance) {
  double variance = 0.0;
  int num_links = 0;
  for (const OdometryLink& link : chain.problem.links) {
    if (!link.has_wheel_yaw || link.dt_s <= 0.0) continue;
    // Derivative of (logged yaw + curvature * distance) / logged per true, at
    // (1, 0).
    const Eigen::Vector2d by_unknowns =
        Eigen::Vector2d(-link.wheel.yaw_rad, link.wheel.distance_m) / link.dt_s;
    variance += by_unknowns.dot(wheel_yaw_covariance * by_unknowns);
    ++num_links;
  }
  if (num_links == 0) return Eigen::Matrix3d::Zero();
  const Eigen::Vector3d up =
      chain.problem.imu_from_wheel.rotation * Eigen::Vector3d::UnitZ();
  return variance / num_links * up * up.transpose() +
         kTiltRateSigma * kTiltRateSigma * Eigen::Matrix3d::Identity();
}

}  // namespace

void FillCovariances(const ChainProblem& chain, OdometryFusionResult* result) {
  result->motions.resize(chain.NumLinks());
  Marginals sums = CollectMarginals(chain, result);
  sums.noise.Fill(chain.problem.wheel_persistence, result);
  const Shared::Vector growth = sums.shared.Growth();
  for (size_t k = 0; k < chain.NumLinks(); ++k) {
    const auto& by_shared = sums.by_shared[k];
    result->motions[k].covariance +=
        by_shared * growth.matrix().asDiagonal() * by_shared.transpose();
  }
  const Eigen::Vector3d root =
      (1.0 + growth.segment<3>(Shared::kGyro)).sqrt().matrix();
  result->gyroscope_bias_covariance =
      (root.asDiagonal() * result->gyroscope_bias_covariance *
       root.asDiagonal())
          .eval();
  const auto& links = chain.problem.links;
  if (std::none_of(links.begin(), links.end(),
                   [](const OdometryLink& link) { return link.has_imu; })) {
    result->gyroscope_bias_covariance =
        WheelYawRateCovariance(chain, sums.wheel_yaw_covariance);
  }
  result->gyroscope_bias_sigma =
      std::sqrt(result->gyroscope_bias_covariance.trace() / 3.0);
  result->wheel_delay_sigma_s = std::sqrt(sums.delay_variance);
  const double length = chain.globals.values[ChainGlobals::kLoggedLength];
  result->wheel_scale_sigma =
      std::sqrt(sums.length_variance * (1.0 + growth[Shared::kScale])) /
      (length * length);
  result->driving_direction_sigma =
      (sums.driving_variance * (1.0 + growth.segment<2>(Shared::kDrivingYaw)))
          .sqrt()
          .matrix();
}

}  // namespace adasfm
