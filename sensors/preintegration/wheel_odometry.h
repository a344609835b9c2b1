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
  double yaw_rate = 0.0;  // rad/s; 0 where ObservesYaw says no
};

struct WheelNoise {
  // White noise densities, m/s/sqrt(Hz) (rad/s/sqrt(Hz) for yaw). A wheel
  // frame does not move sideways or up, but for tyres and springs.
  double forward = 0.01;
  double lateral = 0.02;
  double vertical = 0.02;
  double yaw_rate = 0.01;
  // 1 sigma of the distance (m) and the turn (rad) over any interval, however
  // short: counters round at both ends.
  double distance_rounding = 0.0;
  double yaw_rounding = 0.0;
};

// Speeds from samples of any type but kOdometry. Ticks become speeds between
// two counts; wrapped or reset counters are the reader's business.
std::vector<WheelSpeed> ComputeWheelSpeeds(
    const std::vector<WheelSample>& samples,
    const SensorCalibration& calibration);

// The wheels' motion over an interval in the body frame at its start. The
// wheel frame's origin moves by
//   (M d + N (phi x d)) / q,
// q the logged length of a true metre, d the forward direction in the body
// frame, phi the rotation vector by which the true rotation over the interval
// exceeds the profile's: the profile gives the shape of the turn, the state its
// end (docs/reference/sensors.md).
struct WheelMotion {
  double dt_s = 0.0;
  Eigen::Matrix3d displacement_map = Eigen::Matrix3d::Zero();  // M, metres
  Eigen::Matrix3d rotation_moment = Eigen::Matrix3d::Zero();   // N, metres
  Eigen::Quaterniond profile_rotation = Eigen::Quaterniond::Identity();
  // Of the displacement, m^2.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double distance_m = 0.0;  // signed, along the path
  double yaw_rad = 0.0;     // about the wheel frame's z, as the wheels saw it
  double yaw_variance = 0.0;
  // A trajectory knows more than its yaw.
  bool has_rotation = false;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Matrix3d rotation_covariance = Eigen::Matrix3d::Identity();
};

bool CoversInterval(const std::vector<WheelSpeed>& speeds, timestamp_t start_ns,
                    timestamp_t end_ns, double max_gap_s);

// Integrates speeds along the profile of rotations (from PreintegrateImu; with
// an empty profile the wheels' own yaw turns the body). Throws
// std::invalid_argument when the log does not reach over [start, end].
WheelMotion PreintegrateWheel(const std::vector<WheelSpeed>& speeds,
                              timestamp_t start_ns, timestamp_t end_ns,
                              const Eigen::Quaterniond& imu_from_wheel,
                              const WheelNoise& noise,
                              const std::vector<RotationAtTime>& profile);

}  // namespace adasfm
