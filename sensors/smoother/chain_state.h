// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The unknowns of one time, in the order of their 15 tangent coordinates. All
// but the heading are local to the machine, so that a drift of kilometres or of
// full rotations never enters the equations (docs/reference/sensors.md).
struct ChainState {
  enum Offset {
    kRotation = 0,
    kVelocity = 3,
    kGyro = 6,
    kAccel = 9,
    kStep = 12
  };
  static constexpr int kSize = 15;

  OdometryState state;
  // From the previous state's position to this one's, in the previous frame.
  Eigen::Vector3d step_in_previous = Eigen::Vector3d::Zero();

  // R <- Exp_z(d_z) Exp((d_x, d_y, 0)) R; all other coordinates are added.
  void Retract(const Eigen::Matrix<double, kSize, 1>& delta);
};

// Prior sigma of the delay of the wheels' readings behind the motion: half of
// the log's period where a speed is a difference of counts, and the time on a
// bus.
inline constexpr double kWheelDelaySigmaS = 0.03;

// The unknowns that all states share.
struct ChainGlobals {
  enum Offset {
    kLoggedLength = 0,
    kLoggedYaw,
    kCurvature,  // after kLoggedYaw: joint prior
    kDrivingYaw,
    kDrivingPitch,
    kWheelDelay
  };
  static constexpr int kSize = 6;
  using Vector = Eigen::Matrix<double, kSize, 1>;

  // Logged length = first * true length, logged yaw = second * true yaw - third
  // * distance; the forward direction is rotated by the driving angles. A wheel
  // reading describes the motion kWheelDelay (s) before its time stamp: a speed
  // is the mean since the previous reading, and transmission takes time.
  // Factors multiply the estimated quantities, not the logged ones: a factor of
  // noisy readings would be biased low, since a smaller factor also makes the
  // noise smaller.
  Vector values = (Vector() << 1.0, 1.0, 0.0, 0.0, 0.0, 0.0).finished();

  static Vector PriorMeans() { return ChainGlobals().values; }
  static Vector PriorSigmas(const OdometryFusionOptions& options);
  // The direction of driving: unit vector in the body frame, and its derivative
  // by (yaw, pitch).
  Eigen::Vector3d Forward(const Eigen::Quaterniond& imu_from_wheel,
                          Eigen::Matrix<double, 3, 2>* jacobian) const;
};

}  // namespace adasfm
