// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// All that moves the machine, on the IMU's clock.
struct MotionLogs {
  std::vector<ImuSample> imu;
  std::vector<WheelSpeed> wheel;
  std::vector<OdometryPose> odometry;

  bool IsEmpty() const {
    return imu.empty() && wheel.empty() && odometry.empty();
  }
  // The first and last time that the main sensor (the IMU when there is one)
  // covers. Undefined when empty.
  timestamp_t StartNs() const;
  timestamp_t EndNs() const;
};

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
  // Of the given times, their index in times_ns.
  std::vector<size_t> indices;
};

// The times of the states: the given ones (in order, within the logs), and
// enough between and around them.
OdometryTimeline BuildTimeline(const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs,
                               const OdometryLinkOptions& options);

// Whether the machine stands still in the second around a time: the wheels (if
// any) do not turn and the IMU shows noise only.
StandstillKind FindStandstill(const MotionLogs& logs, timestamp_t time_ns,
                              const ImuNoise& noise, double imu_rate_hz);

// One link between each two successive times. bias is subtracted from the IMU.
std::vector<OdometryLink> BuildOdometryLinks(
    const std::vector<timestamp_t>& times_ns, const MotionLogs& logs,
    const SensorCalibration& calibration, const ImuBias& bias,
    const OdometryLinkOptions& options);

}  // namespace adasfm
