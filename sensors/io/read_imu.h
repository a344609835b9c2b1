// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/io/log_checks.h"

namespace adasfm {

// Reads an IMU log: EuRoC CSV (commas), 4Seasons imu.txt (spaces), both
// "ns wx wy wz ax ay az"; a KITTI raw oxts folder (timestamps.txt and
// data/); or a ROS bag (sensors/io/read_bag.h). Times that go back,
// duplicates, NaN, a wrong number of columns, degrees for radians, g for m/s^2
// and |a| at rest off by more than 5 % are errors that name file, line, cause
// and remedy. Gaps of more than three periods are added to warnings (may be
// null).
StatusOr<std::vector<ImuSample>> ReadImu(
    const std::string& path, std::vector<std::string>* warnings = nullptr);

// As above, but units are not checked (CheckImuUnits), so that bad samples can
// be left out before. origin receives where the samples come from.
StatusOr<std::vector<ImuSample>> ReadImuSamples(
    const std::string& path, std::vector<std::string>* warnings,
    LogOrigin* origin);

}  // namespace adasfm
