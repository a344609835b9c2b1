// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/bags/ros_messages.h"

namespace adasfm {

// Whether a log's path names a bag: "drive.mcap", or "drive.mcap:/imu/data"
// where the bag has several topics of the log's type.
bool IsBagPath(const std::string& path);

// Each reads one log of a bag. Values are not checked beyond ReadBagLogs.
StatusOr<std::vector<ImuSample>> ReadBagImu(const std::string& path,
                                            std::vector<std::string>* warnings);
StatusOr<std::vector<OdometryPose>> ReadBagOdometry(
    const std::string& path, std::vector<std::string>* warnings);
StatusOr<std::vector<RosNavSatFix>> ReadBagGnss(
    const std::string& path, std::vector<std::string>* warnings);
// For kVelocity, kSpeed and kTicks; an error for other types.
StatusOr<std::vector<WheelSample>> ReadBagWheel(
    const std::string& path, WheelType type,
    std::vector<std::string>* warnings);

}  // namespace adasfm
