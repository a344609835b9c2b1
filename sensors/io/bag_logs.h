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

// The logs of a drive, read from a bag in one pass. Logs are in the order of
// the header stamps (bags are in the order of arrival). Values are finite,
// quaternions have unit length and every message has a stamp; nothing else is
// checked.
struct BagLogs {
  std::vector<ImuSample> imu;
  WheelType wheel_type = WheelType::kOdometry;  // of the two below
  std::vector<WheelSample> wheel;
  std::vector<OdometryPose> odometry;
  // Only messages with a position.
  std::vector<RosNavSatFix> gnss;
  // Stamps of the photos, ascending, each once.
  std::vector<timestamp_t> image_times_ns;
  std::optional<RosCameraInfo> camera_info;
  // Of /tf_static.
  std::vector<RosTransform> static_transforms;
  // Frames of the messages, without a leading slash; for wheels the moving
  // frame.
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

// The pose target_from_source by the transforms, each used in either direction;
// nothing when the frames are not connected.
std::optional<Rigid3d> FindTransform(
    const std::vector<RosTransform>& transforms, const std::string& target,
    const std::string& source);

}  // namespace adasfm
