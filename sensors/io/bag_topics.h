// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/bags/bag_reader.h"

namespace adasfm {

// Which topics of a bag to read: by name; empty: the only one of its type;
// "none": no topic.
struct BagTopicNames {
  std::string imu;
  std::string wheel;
  std::string image;
  std::string gnss;
};

constexpr char kNoBagTopic[] = "none";

// The topics that were chosen; nothing where the bag has none.
struct BagTopics {
  std::optional<BagTopic> imu;
  std::optional<BagTopic> wheel;
  std::optional<BagTopic> image;
  std::optional<BagTopic> camera_info;  // beside the image's topic
  std::optional<BagTopic> gnss;
};

// The message types of a wheel log: nav_msgs/Odometry for kOdometry, its twist
// or a stamped twist for kVelocity and kSpeed, sensor_msgs/JointState for
// kTicks. Empty for the other types, which no message carries.
std::vector<std::string> WheelMessageTypes(WheelType type);

// The only topic of these types, or the named one. Nothing when the bag has
// none and no name was given, or for kNoBagTopic. An error with a list of
// topics when the named one is missing, or when several fit: `option` is the
// option that chooses one.
StatusOr<std::optional<BagTopic>> FindBagTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::vector<std::string>& types, const std::string& name,
    const std::string& option);

// The topic of the IMU.
StatusOr<std::optional<BagTopic>> FindImuTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::string& name);

// The topic of the positions.
StatusOr<std::optional<BagTopic>> FindGnssTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::string& name);

// The topic of the wheels: of the calibration's type or, without one, odometry
// or twists, or joint states where there are no others.
StatusOr<std::optional<BagTopic>> FindWheelTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::string& name, const std::optional<WheelType>& wheel_type);

// All topics of a drive with photos; an error when there are no photos.
StatusOr<BagTopics> FindDriveTopics(const std::string& bag_path,
                                    const std::vector<BagTopic>& topics,
                                    const BagTopicNames& names,
                                    const std::optional<WheelType>& wheel_type);

}  // namespace adasfm
