// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/status.h"
#include "sensors/io/calibration.h"
#include "sensors/sensor_summary.h"
#include "sensors/smoother/build_odometry_links.h"

namespace adasfm {

// What the estimator asks of its logs before it believes them. Times are those
// of the images, in order, on the IMU's clock.

// An error when the images or the wheels are on another clock: images less than
// 1 ms apart, a wheel log that covers no image. A warning for a wheel log that
// covers less than half of the images.
Status CheckCoverage(const std::vector<timestamp_t>& times_ns,
                     const MotionLogs& logs,
                     std::vector<std::string>* warnings);

// CheckWheels (sensors/calibration_check/check_wheels.h) of logs that have
// both; empty when nothing contradicts.
std::string FindContradiction(const MotionLogs& logs,
                              const SensorCalibration& calibration,
                              std::vector<std::string>* warnings);

// A line about a wheel scale more than 20 % from 1, with its likely causes;
// empty when there is none. One beyond a factor of 2 has no other cause than a
// wheel log that is wrong: is_error says so.
std::string DescribeWheelScale(double scale, bool* is_error);

}  // namespace adasfm
