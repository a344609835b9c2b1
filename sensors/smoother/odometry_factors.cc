// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/odometry_factors.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "sensors/smoother/link_builder.h"

namespace adasfm {
namespace {

// Weak priors: they keep coordinates without any sensor finite.
constexpr double kWeakSpeedSigma = 50.0;  // m/s
constexpr double kWeakStepSigma = 100.0;  // m
constexpr double kWeakAngleSigma = 1.0;   // rad
// Correlation time of an unaided machine's speed, s.
constexpr double kSpeedMemoryS = 10.0;
// Speed of an IMU without wheels, 1 sigma: its only bound.
constexpr double kUnaidedSpeedSigma = 15.0;  // m/s
// Angular rate of a machine at rest, 1 sigma. It is one unknown of a whole
// standstill, so its sigma does not shrink with the duration.
constexpr double kStandstillRateSigma = 1e-4;  // rad/s

// What a machine at rest moves and turns in hours, 1 sigma.
constexpr double kParkedSigma = 0.01;      // m
constexpr double kParkedSigmaRad = 0.002;  // rad

}  // namespace

double RestStepSigma(const OdometryLink& link) {
  const double dt = std::max(link.dt_s, 1e-3);
  const double time = std::max(link.standstill_time_s, dt);
  return std::min(kStandstillSpeedSigma * time, kParkedSigma) *
         std::sqrt(dt / time);
}

void LinkBuilder::AddImu() {
  const ImuPreintegration& imu = link_.imu;
  const ImuBias& bias = first_.state.bias;
  const double dt = imu.dt_s;
  const Eigen::Vector3d gravity(0.0, 0.0, -context_.options->gravity_m_s2);
  const Eigen::Vector3d gravity_in_body = r1_transposed_ * gravity;
  const Eigen::Matrix3d gravity_by_rotation = r1_transposed_ * Hat(gravity);
  const Eigen::Vector3d& v1 = first_.state.velocity_in_imu;
  const Eigen::Vector3d& v2 = second_.state.velocity_in_imu;
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const int row = num_rows_;
  auto block = [&](int block_row, int column) {
    return jacobian_.block<3, 3>(row + block_row, column);
  };

  const Eigen::Vector3d error =
      LogSo3(imu.CorrectedRotation(bias).conjugate() * a_rotation_);
  values_.segment<3>(row) = error;
  AddRelativeRotation<3>(row, RightJacobianInverseSo3(error));
  const Eigen::Vector3d correction =
      imu.rotation_by_gyroscope * (bias.gyroscope - imu.bias.gyroscope);
  block(0, kFirst + ChainState::kGyro) = -RightJacobianInverseSo3(-error) *
                                         RightJacobianSo3(correction) *
                                         imu.rotation_by_gyroscope;

  values_.segment<3>(row + 3) =
      a_ * v2 - v1 - gravity_in_body * dt - imu.CorrectedVelocity(bias);
  AddRelativeRotation<3>(row + 3, -a_ * Hat(v2));
  block(3, kFirst + ChainState::kRotation) -= dt * gravity_by_rotation;
  block(3, kFirst + ChainState::kVelocity) = -identity;
  block(3, kSecond + ChainState::kVelocity) = a_;
  block(3, kFirst + ChainState::kGyro) = -imu.velocity_by_gyroscope;
  block(3, kFirst + ChainState::kAccel) = -imu.velocity_by_accelerometer;

  values_.segment<3>(row + 6) = second_.step_in_previous - v1 * dt -
                                0.5 * dt * dt * gravity_in_body -
                                imu.CorrectedPosition(bias);
  block(6, kFirst + ChainState::kRotation) =
      -0.5 * dt * dt * gravity_by_rotation;
  block(6, kFirst + ChainState::kVelocity) = -dt * identity;
  block(6, kSecond + ChainState::kStep) = identity;
  block(6, kFirst + ChainState::kGyro) = -imu.position_by_gyroscope;
  block(6, kFirst + ChainState::kAccel) = -imu.position_by_accelerometer;
  Whiten<9>(imu.covariance);
  // The rotation comes first, so that its whitened rows depend on the
  // gyroscope's noise only.
  rows_.accelerometer = {row + 3, 6};
}

void LinkBuilder::AddBiasWalk() {
  const ImuNoise& noise = context_.problem->imu_noise;
  const double root_dt = std::sqrt(std::max(link_.dt_s, 1e-6));
  const auto add = [&](int offset, const Eigen::Vector3d& difference,
                       double sigma) {
    for (int i = 0; i < 3; ++i) {
      jacobian_(num_rows_, kFirst + offset + i) = -1.0 / sigma;
      AddScalar(kSecond + offset + i, difference[i], sigma);
    }
  };
  const ImuBias& b1 = first_.state.bias;
  const ImuBias& b2 = second_.state.bias;
  add(ChainState::kGyro, b2.gyroscope - b1.gyroscope,
      noise.gyroscope_random_walk * root_dt);
  add(ChainState::kAccel, b2.accelerometer - b1.accelerometer,
      noise.accelerometer_random_walk * root_dt);
}

void LinkBuilder::AddVision() {
  AddRotationResidual(link_.visual_rotation, link_.visual_sigma_rad *
                                                 link_.visual_sigma_rad *
                                                 Eigen::Matrix3d::Identity());
}

void LinkBuilder::AddStandstill() {
  if (link_.is_parked) {
    const double variance = kParkedSigmaRad * kParkedSigmaRad * link_.dt_s /
                            link_.standstill_time_s;
    AddRotationResidual(Eigen::Quaterniond::Identity(),
                        variance * Eigen::Matrix3d::Identity());
    AddRest();
    return;
  }
  const double dt = std::max(link_.dt_s, 1e-3);
  // The mean rate over all links of the standstill has the variance density^2 /
  // time + sigma^2. The second part is made a density, too.
  const Eigen::Array3d density =
      link_.standstill_rate_density.array().square() +
      kStandstillRateSigma * kStandstillRateSigma *
          std::max(link_.standstill_time_s, dt);
  AddRotationResidual(Eigen::Quaterniond::Identity(),
                      (dt * density).matrix().asDiagonal());
  if (link_.standstill != StandstillKind::kAtRest) return;
  AddRest();
}

void LinkBuilder::AddRest() {
  AddVector(kSecond + ChainState::kStep, second_.step_in_previous,
            RestStepSigma(link_));
  AddVector(kFirst + ChainState::kVelocity, first_.state.velocity_in_imu,
            kStandstillSpeedSigma);
  AddVector(kSecond + ChainState::kVelocity, second_.state.velocity_in_imu,
            kStandstillSpeedSigma);
}

void LinkBuilder::AddWeakPriors() {
  const Eigen::Vector3d& velocity = second_.state.velocity_in_imu;
  const Eigen::Vector3d& step = second_.step_in_previous;
  if (!link_.has_imu) {
    AddVector(kSecond + ChainState::kVelocity, velocity, kWeakSpeedSigma);
  } else if (!link_.has_wheel) {
    // The prior is independent at every state, so its information is spread
    // over the correlation time.
    const double memory = 2.0 * kSpeedMemoryS / std::max(link_.dt_s, 1e-3);
    AddVector(kSecond + ChainState::kVelocity, velocity,
              kUnaidedSpeedSigma * std::sqrt(std::max(1.0, memory)));
  }
  if (link_.has_imu || link_.has_wheel) {
    const bool has_rotation =
        link_.has_imu || link_.has_wheel_yaw || link_.wheel.has_rotation;
    if (has_rotation) return;
  } else {
    AddVector(kSecond + ChainState::kStep, step, kWeakStepSigma);
  }
  AddRotationResidual(
      Eigen::Quaterniond::Identity(),
      kWeakAngleSigma * kWeakAngleSigma * Eigen::Matrix3d::Identity());
}

LinkResiduals ComputeLinkResiduals(const LinkContext& context,
                                   const OdometryLink& link,
                                   const ChainState& first,
                                   const ChainState& second,
                                   const ChainGlobals& globals,
                                   double wheel_weight) {
  LinkBuilder builder(context, link, first, second, globals);
  if (link.has_imu) builder.AddImu();
  builder.AddBiasWalk();
  if (link.has_wheel && !link.is_parked) {
    builder.AddWheel(wheel_weight);
  }
  if (link.has_vision) builder.AddVision();
  if (link.standstill != StandstillKind::kNone) builder.AddStandstill();
  builder.AddWeakPriors();
  return builder.Finish();
}

}  // namespace adasfm
