// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

struct OdometryLinkOptions {
  double max_imu_gap_s = 0.1;
  double max_wheel_gap_s = 0.25;
  double max_link_s = 0.5;
  double max_lead_s = 20.0;
  double lateral_speed_noise = 0.05;  // m/s/sqrt(Hz)
  double vertical_speed_noise = 0.2;  // m/s/sqrt(Hz)
};

// States in order of time; those of the images and others between.
struct OdometryTimeline {
  std::vector<timestamp_t> times_ns;
  // For each given time its index in times_ns.
  std::vector<size_t> indices;
};

// The times of the states: the given ones (in order, within the logs), and
// others between and around them for max_link_s (not in gaps above 10 min).
OdometryTimeline BuildTimeline(const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs,
                               const OdometryLinkOptions& options);

// One link between each two successive times. bias is subtracted from the IMU.
std::vector<OdometryLink> BuildOdometryLinks(
    const std::vector<timestamp_t>& times_ns, const MotionLogs& logs,
    const SensorCalibration& calibration, const ImuBias& bias,
    const OdometryLinkOptions& options);

}  // namespace adasfm
