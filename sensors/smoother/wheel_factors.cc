// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "sensors/smoother/link_builder.h"
#include "sensors/smoother/wheel_equation.h"

namespace adasfm {
namespace {

// Roll and pitch of a machine without IMU.
constexpr double kPlanarRotationNoise = 0.03;  // rad/sqrt(s)

}  // namespace

void LinkBuilder::AddWheel(double weight) {
  const WheelMotion& wheel = link_.wheel;
  const Eigen::Vector3d& lever = context_.problem->imu_from_wheel.translation;
  Eigen::Matrix<double, 3, 2> forward_by_direction;
  const Eigen::Vector3d forward = globals_.Forward(
      context_.problem->imu_from_wheel.rotation, &forward_by_direction);
  const double logged_per_true = globals_.values[ChainGlobals::kLoggedLength];
  const Eigen::Vector3d phi =
      LogSo3(wheel.profile_rotation.conjugate() * a_rotation_);
  const Eigen::Matrix3d map = DisplacementMap(wheel, phi);
  // Displacement of the wheel frame's origin.
  const Eigen::Vector3d moved = second_.step_in_previous + a_ * lever - lever;
  const int row = num_rows_;
  values_.segment<3>(row) = logged_per_true * moved - map * forward;
  jacobian_.block<3, 3>(row, kSecond + ChainState::kStep) =
      logged_per_true * Eigen::Matrix3d::Identity();
  AddRelativeRotation<3>(row, -logged_per_true * a_ * Hat(lever) +
                                  wheel.rotation_moment * Hat(forward) *
                                      RightJacobianInverseSo3(phi));
  jacobian_.block<3, 1>(row, kGlobals + ChainGlobals::kLoggedLength) = moved;
  jacobian_.block<3, 2>(row, kGlobals + ChainGlobals::kDrivingYaw) =
      -map * forward_by_direction;
  // In the wheel frame in the middle of the rotation, the first row is the
  // speed.
  const Eigen::Matrix3d wheel_from_start =
      StartFromMiddleWheel(wheel, context_.problem->imu_from_wheel.rotation)
          .transpose();
  values_.segment<3>(row) = (wheel_from_start * values_.segment<3>(row)).eval();
  jacobian_.middleRows<3>(row) =
      (wheel_from_start * jacobian_.middleRows<3>(row)).eval();
  if (link_.has_imu) AddWheelDelay(row);
  Eigen::Matrix3d covariance =
      wheel_from_start * wheel.covariance * wheel_from_start.transpose();
  const double persistence = context_.problem->wheel_persistence;
  covariance(0, 0) *= persistence;
  Whiten<3>(covariance / weight);
  rows_.wheel_speed = {row, 1};
  // A slip is judged by the error of one link, without the persistence.
  wheel_chi2_ += (persistence * values_[row] * values_[row] +
                  values_.segment<2>(row + 1).squaredNorm()) /
                 weight;
  if (wheel.has_rotation) {
    AddRotationResidual(wheel.rotation, wheel.rotation_covariance / weight);
    rows_.wheel_yaw = {row + 3, 3};
    wheel_chi2_ += values_.segment<3>(row + 3).squaredNorm() / weight;
    return;
  }
  if (link_.has_wheel_yaw) AddWheelYaw(weight);
  if (!link_.has_imu) AddPlanarRotation();
}

// To first order a path that begins and ends earlier is shorter by the delay
// times the increase of the speed. The speed is the state's: a logged one is
// rounded, and the factor of an unknown should be free of noise.
void LinkBuilder::AddWheelDelay(int forward_row) {
  const Rigid3d& imu_from_wheel = context_.problem->imu_from_wheel;
  const Eigen::Vector3d forward =
      imu_from_wheel.rotation * Eigen::Vector3d::UnitX();
  const double speed_change =
      WheelSpeedChange(link_, imu_from_wheel, first_.state, second_.state);
  const double delay_s = globals_.values[ChainGlobals::kWheelDelay];
  values_[forward_row] -= delay_s * speed_change;
  jacobian_.block<1, 3>(forward_row, kSecond + ChainState::kVelocity) -=
      delay_s * forward.transpose();
  jacobian_.block<1, 3>(forward_row, kFirst + ChainState::kVelocity) +=
      delay_s * forward.transpose();
  jacobian_(forward_row, kGlobals + ChainGlobals::kWheelDelay) = -speed_change;
}

void LinkBuilder::AddWheelYaw(double weight) {
  const WheelMotion& wheel = link_.wheel;
  const Eigen::Vector3d up =
      context_.problem->imu_from_wheel.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d turn = LogSo3(a_rotation_);
  const double rate_change = link_.has_imu ? up.dot(link_.rate_change) : 0.0;
  const double delay_s = globals_.values[ChainGlobals::kWheelDelay];
  const double true_yaw = up.dot(turn) - delay_s * rate_change;
  const double root_weight = std::sqrt(weight / wheel.yaw_variance);
  const int row = num_rows_++;
  rows_.wheel_yaw = {row, 1};
  const double logged_per_true = globals_.values[ChainGlobals::kLoggedYaw];
  values_[row] = root_weight *
                 (logged_per_true * true_yaw -
                  globals_.values[ChainGlobals::kCurvature] * wheel.distance_m -
                  wheel.yaw_rad);
  AddRelativeRotation<1>(row, root_weight * logged_per_true * up.transpose() *
                                  RightJacobianInverseSo3(turn));
  jacobian_(row, kGlobals + ChainGlobals::kLoggedYaw) = root_weight * true_yaw;
  jacobian_(row, kGlobals + ChainGlobals::kWheelDelay) =
      -root_weight * logged_per_true * rate_change;
  jacobian_(row, kGlobals + ChainGlobals::kCurvature) =
      -root_weight * wheel.distance_m;
  wheel_chi2_ += values_[row] * values_[row] / weight;
}

void LinkBuilder::AddPlanarRotation() {
  const Eigen::Matrix3d wheel_from_imu =
      context_.problem->imu_from_wheel.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d turn = LogSo3(a_rotation_);
  const double sigma =
      kPlanarRotationNoise * std::sqrt(std::max(link_.dt_s, 1e-6));
  const Eigen::Matrix<double, 2, 3> by_rotation =
      wheel_from_imu.topRows<2>() * RightJacobianInverseSo3(turn) / sigma;
  values_.segment<2>(num_rows_) = wheel_from_imu.topRows<2>() * turn / sigma;
  AddRelativeRotation<2>(num_rows_, by_rotation);
  num_rows_ += 2;
}

}  // namespace adasfm
