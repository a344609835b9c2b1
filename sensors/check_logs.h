// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/status.h"
#include "sensors/io/calibration.h"
#include "sensors/sensor_summary.h"
#include "sensors/smoother/build_odometry_links.h"

namespace adasfm {

// Checks of the logs before the estimation. Times are those of the images,
// ascending, on the IMU's clock.

// Error for a wrong clock or unit: images with a median period below 1 ms, or a
// wheel log that covers no image. Warning for a wheel log that covers less than
// half of the images.
Status CheckCoverage(const std::vector<timestamp_t>& times_ns,
                     const MotionLogs& logs,
                     std::vector<std::string>* warnings);

// The contradiction found by CheckWheels
// (sensors/calibration_check/check_wheels.h); empty when there is none, or
// without an IMU log or a wheel log.
std::string FindContradiction(const MotionLogs& logs,
                              const SensorCalibration& calibration,
                              std::vector<std::string>* warnings);

// One line with the likely causes of a wheel scale more than 20 % from 1; empty
// for other scales. is_error: the scale is off by a factor of 2 or more, which
// only a wrong wheel log explains.
std::string DescribeWheelScale(double scale, bool* is_error);

}  // namespace adasfm
