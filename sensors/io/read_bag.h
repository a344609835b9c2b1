// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/bags/ros_messages.h"

namespace adasfm {

// Where a log's path names a bag: "drive.mcap", or "drive.mcap:/imu/data" where
// the bag holds several topics of the log's type.
bool IsBagPath(const std::string& path);

// One log of a bag named so. Values are not checked beyond ReadBagLogs.
StatusOr<std::vector<ImuSample>> ReadBagImu(const std::string& path,
                                            std::vector<std::string>* warnings);
StatusOr<std::vector<OdometryPose>> ReadBagOdometry(
    const std::string& path, std::vector<std::string>* warnings);
StatusOr<std::vector<RosNavSatFix>> ReadBagGnss(
    const std::string& path, std::vector<std::string>* warnings);
// Of every type but kOdometry.
StatusOr<std::vector<WheelSample>> ReadBagWheel(
    const std::string& path, WheelType type,
    std::vector<std::string>* warnings);

}  // namespace adasfm
