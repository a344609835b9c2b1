// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/chain_state.h"

#include <cmath>

#include "core/so3.h"

namespace adasfm {

void ChainState::Retract(const Eigen::Matrix<double, kSize, 1>& delta) {
  const Eigen::Quaterniond tilt =
      ExpSo3(Eigen::Vector3d(delta[0], delta[1], 0.0));
  const Eigen::Quaterniond heading =
      ExpSo3(Eigen::Vector3d(0.0, 0.0, delta[2]));
  state.world_from_imu = (heading * tilt * state.world_from_imu).normalized();
  state.velocity_in_imu += delta.segment<3>(kVelocity);
  state.bias.gyroscope += delta.segment<3>(kGyro);
  state.bias.accelerometer += delta.segment<3>(kAccel);
  step_in_previous += delta.segment<3>(kStep);
}

ChainGlobals::Vector ChainGlobals::PriorSigmas(
    const OdometryFusionOptions& options) {
  // Zero means exactly known: a sigma too small to move anything.
  constexpr double kFixed = 1e-7;
  const double driving = DegToRad(options.driving_direction_sigma_deg);
  Vector sigmas;
  sigmas << options.wheel_scale_sigma, options.wheel_track_sigma,
      options.wheel_curvature_sigma, driving, driving, kWheelDelaySigmaS;
  return sigmas.cwiseMax(kFixed);
}

Eigen::Vector3d ChainGlobals::Forward(
    const Eigen::Quaterniond& imu_from_wheel,
    Eigen::Matrix<double, 3, 2>* jacobian) const {
  const double cy = std::cos(values[kDrivingYaw]);
  const double sy = std::sin(values[kDrivingYaw]);
  const double cp = std::cos(values[kDrivingPitch]);
  const double sp = std::sin(values[kDrivingPitch]);
  const Eigen::Matrix3d rotation = imu_from_wheel.toRotationMatrix();
  if (jacobian != nullptr) {
    jacobian->col(0) = rotation * Eigen::Vector3d(-cp * sy, cp * cy, 0.0);
    jacobian->col(1) = rotation * Eigen::Vector3d(-sp * cy, -sp * sy, -cp);
  }
  return rotation * Eigen::Vector3d(cp * cy, cp * sy, -sp);
}

}  // namespace adasfm
