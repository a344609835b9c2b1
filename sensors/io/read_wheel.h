// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/io/log_checks.h"

namespace adasfm {

// The type of a log by its header line (docs/reference/sensors.md), or
// kOdometry for eight columns separated by spaces.
StatusOr<WheelType> ReadWheelType(const std::string& path);

// Reads a log of every type but kOdometry. A header that states another type
// than expected_type is an error. Other errors and warnings as for ReadImu.
// origin (may be null) receives where the samples come from; then speeds are
// not checked, so that bad samples can be left out before CheckWheelUnits.
StatusOr<std::vector<WheelSample>> ReadWheel(
    const std::string& path, WheelType expected_type,
    std::vector<std::string>* warnings = nullptr, LogOrigin* origin = nullptr);

// An error for speeds, yaw rates and steering angles that no machine has.
Status CheckWheelUnits(const std::vector<WheelSample>& samples, WheelType type,
                       const LogOrigin& origin);

// Reads a trajectory of lines "t tx ty tz qx qy qz qw", t in seconds (TUM) or
// nanoseconds (4Seasons' result.txt), or a ROS bag
// (sensors/io/read_bag.h).
StatusOr<std::vector<OdometryPose>> ReadOdometry(
    const std::string& path, std::vector<std::string>* warnings = nullptr);

}  // namespace adasfm
