// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/motion_logs.h"

namespace adasfm {

timestamp_t MotionLogs::StartNs() const {
  if (!imu.empty()) return imu.front().timestamp_ns;
  return wheel.empty() ? odometry.front().timestamp_ns
                       : wheel.front().timestamp_ns;
}

timestamp_t MotionLogs::EndNs() const {
  if (!imu.empty()) return imu.back().timestamp_ns;
  return wheel.empty() ? odometry.back().timestamp_ns
                       : wheel.back().timestamp_ns;
}

}  // namespace adasfm
