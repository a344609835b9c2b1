// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

// All motion logs, on the IMU's clock.
struct MotionLogs {
  std::vector<ImuSample> imu;
  std::vector<WheelSpeed> wheel;
  std::vector<OdometryPose> odometry;
  // Intervals in which cameras saw the machine move, in order of time.
  std::vector<std::pair<timestamp_t, timestamp_t>> seen_moving_ns;
  // Long standstills without their ends (FindParkedIntervals), in order of
  // time.
  std::vector<std::pair<timestamp_t, timestamp_t>> parked_ns;

  bool IsEmpty() const {
    return imu.empty() && wheel.empty() && odometry.empty();
  }
  // The first and last time that the main sensor (the IMU when there is one)
  // covers. Undefined when empty.
  timestamp_t StartNs() const;
  timestamp_t EndNs() const;
};

}  // namespace adasfm
