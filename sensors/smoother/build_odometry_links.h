// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

struct OdometryLinkOptions {
  // A link between two times needs samples at most this far apart: beyond it
  // linear interpolation of a vehicle's motion is a guess.
  double max_imu_gap_s = 0.1;
  double max_wheel_gap_s = 0.25;
  // Noise of the lateral and vertical speed of the wheel frame, m/s/sqrt(Hz).
  // Vertical is larger: springs, and slopes that T_imu_wheel does not follow.
  double lateral_speed_noise = 0.05;
  double vertical_speed_noise = 0.2;

  bool IsValid(std::string* error) const;
};

// States in order of time; those of the images and others between.
struct OdometryTimeline {
  std::vector<timestamp_t> times_ns;
  // For each given time its index in times_ns.
  std::vector<size_t> indices;
};

// The times of the states: the given ones (in order, within the logs), and
// others so that no link is longer than 0.5 s: between them (not while parked,
// and not in gaps above 10 min) and up to 20 s before and after them.
OdometryTimeline BuildTimeline(const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs);

// One link between each two successive times. bias is subtracted from the IMU.
// A link across a gap above 10 min has no sensors.
std::vector<OdometryLink> BuildOdometryLinks(
    const std::vector<timestamp_t>& times_ns, const MotionLogs& logs,
    const SensorCalibration& calibration, const ImuBias& bias,
    const OdometryLinkOptions& options);

}  // namespace adasfm
