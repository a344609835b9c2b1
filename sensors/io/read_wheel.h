// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/io/log_checks.h"

namespace adasfm {

// What the log says it is: by its header line (docs/reference/sensors.md), or
// kOdometry for eight columns separated by spaces.
StatusOr<WheelType> ReadWheelType(const std::string& path);

// Reads a log of every type but kOdometry. When expected_type is not what the
// header says, that is an error. Errors and warnings as for ReadImu. origin
// (may be null) receives where the samples come from; then speeds are not
// checked (CheckWheelUnits), so that bad samples can be left out before.
StatusOr<std::vector<WheelSample>> ReadWheel(
    const std::string& path, WheelType expected_type,
    std::vector<std::string>* warnings = nullptr, LogOrigin* origin = nullptr);

// An error for speeds and yaw rates that no machine has.
Status CheckWheelUnits(const std::vector<WheelSample>& samples, WheelType type,
                       const LogOrigin& origin);

// Reads a trajectory of lines "t tx ty tz qx qy qz qw", t in seconds (TUM) or
// nanoseconds (4Seasons' result.txt), or a ROS bag
// (sensors/io/read_bag.h).
StatusOr<std::vector<OdometryPose>> ReadOdometry(
    const std::string& path, std::vector<std::string>* warnings = nullptr);

}  // namespace adasfm
