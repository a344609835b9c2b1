// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/bags/bag_reader.h"
#include "sensors/io/bag_topics.h"

namespace adasfm {

// What a bag holds of a drive, in one pass. Logs are in the order of their
// headers' stamps (bags are in the order of arrival); values are finite and
// every message has a stamp, all else is unchecked.
struct BagLogs {
  std::vector<ImuSample> imu;
  WheelType wheel_type = WheelType::kOdometry;  // of the two below
  std::vector<WheelSample> wheel;
  std::vector<OdometryPose> odometry;
  // Those with a position.
  std::vector<RosNavSatFix> gnss;
  // Stamps of the photos, ascending, each once.
  std::vector<timestamp_t> image_times_ns;
  std::optional<RosCameraInfo> camera_info;
  // Of /tf_static.
  std::vector<RosTransform> static_transforms;
  // In which the messages are given, without a leading slash; of wheels the
  // frame that moves.
  std::string imu_frame;
  std::string wheel_frame;
  std::string image_frame;
};

// Reads the chosen topics. Wheels as wheel_type or, without one, as their
// message suggests (FindWheelTopic): odometry as kOdometry, twists as
// kVelocity, joint states as kTicks in radians. An error names the message.
StatusOr<BagLogs> ReadBagLogs(const std::string& path, BagReader* bag,
                              const BagTopics& topics,
                              const std::optional<WheelType>& wheel_type,
                              std::vector<std::string>* warnings);

// Poses of target frame from source frame by the transforms, in either
// direction; nothing when they are not connected.
std::optional<Rigid3d> FindTransform(
    const std::vector<RosTransform>& transforms, const std::string& target,
    const std::string& source);

}  // namespace adasfm
