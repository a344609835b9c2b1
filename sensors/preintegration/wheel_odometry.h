// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/preintegration/imu_preintegration.h"

namespace adasfm {

// One wheel reading as forward speed and yaw rate of the wheel frame.
struct WheelSpeed {
  timestamp_t timestamp_ns = 0;
  double speed = 0.0;     // m/s
  double yaw_rate = 0.0;  // rad/s; 0 where it is not observed
};

struct WheelNoise {
  // White noise densities, m/s/sqrt(Hz) (rad/s/sqrt(Hz) for yaw). Apart from
  // tyres and springs, a wheel frame does not move sideways or up.
  double forward = 0.01;
  double lateral = 0.02;
  double vertical = 0.02;
  double yaw_rate = 0.01;
  // 1 sigma of the distance (m) and the yaw (rad) over any interval, however
  // short: counters round at both ends.
  double distance_rounding = 0.0;
  double yaw_rounding = 0.0;
};

// Speeds from samples of any type but kOdometry. Counts become the speeds
// between them. Counters must not wrap or reset.
std::vector<WheelSpeed> ComputeWheelSpeeds(
    const std::vector<WheelSample>& samples,
    const SensorCalibration& calibration);

// The motion of the wheels over an interval, in the body frame at its start.
// The origin of the wheel frame moves by
//   (M d + N (phi x d)) / q,
// with q the logged length of a true metre, d the forward direction in the body
// frame, and phi the rotation vector by which the true rotation over the
// interval exceeds that of the profile. The profile gives the course of the
// rotation, the state its end (docs/reference/sensors.md).
struct WheelMotion {
  double dt_s = 0.0;
  Eigen::Matrix3d displacement_map = Eigen::Matrix3d::Zero();  // M, metres
  Eigen::Matrix3d rotation_moment = Eigen::Matrix3d::Zero();   // N, metres
  Eigen::Quaterniond profile_rotation = Eigen::Quaterniond::Identity();
  // Of the displacement, m^2.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double distance_m = 0.0;  // signed, along the path
  double yaw_rad = 0.0;     // about the wheel frame's z, by the wheels
  double yaw_variance = 0.0;
  // Of an odometry trajectory, which observes the full rotation.
  bool has_rotation = false;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Matrix3d rotation_covariance = Eigen::Matrix3d::Identity();
};

// Integrates speeds along the profile of rotations (from PreintegrateImu; an
// empty profile is replaced by the yaw of the wheels). Throws
// std::invalid_argument when the log does not cover [start, end].
WheelMotion PreintegrateWheel(const std::vector<WheelSpeed>& speeds,
                              timestamp_t start_ns, timestamp_t end_ns,
                              const Eigen::Quaterniond& imu_from_wheel,
                              const WheelNoise& noise,
                              const std::vector<RotationAtTime>& profile);

}  // namespace adasfm
