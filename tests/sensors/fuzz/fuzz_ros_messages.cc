// SPDX-License-Identifier: BSD-3-Clause
#include <ros/serialization.h>

#include <cmath>
#include <vector>

#include "memory_file.h"
#include "sensors/ros_messages.h"

namespace {

// The message that the bytes are, as a bag holds it. False when they are none.
template <typename Message>
bool Deserialize(const uint8_t* data, size_t size, Message* message) {
  std::vector<uint8_t> bytes(data, data + size);
  ros::serialization::IStream stream(bytes.data(), bytes.size());
  try {
    ros::serialization::deserialize(stream, *message);
  } catch (const ros::serialization::StreamOverrunException&) {
    return false;
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  sensor_msgs::Imu imu;
  ImuSample sample;
  if (Deserialize(data, size, &imu) &&
      ConvertRosMessage(imu, &sample).empty()) {
    Require(sample.timestamp_ns > 0);
    Require(sample.angular_velocity.allFinite());
    Require(sample.specific_force.allFinite());
  }
  nav_msgs::Odometry odometry;
  OdometryPose pose;
  if (Deserialize(data, size, &odometry) &&
      ConvertRosMessage(odometry, &pose).empty()) {
    Require(pose.timestamp_ns > 0);
    Require(pose.world_from_body.translation.allFinite());
    Require(std::abs(pose.world_from_body.rotation.norm() - 1.0) < 1e-9);
  }
  return 0;
}
