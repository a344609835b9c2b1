// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>

#include <cmath>
#include <string>

#include "core/sensor_log.h"

namespace adasfm {

// What of a ROS 1 message is read (docs/reference/formats.md). Only in builds
// that read bags. Both return what is wrong with the message, nothing when it
// is usable; otherwise the sample is undefined.

inline std::string ConvertRosStamp(const ros::Time& stamp,
                                   timestamp_t* timestamp_ns) {
  *timestamp_ns = static_cast<timestamp_t>(stamp.toNSec());
  return *timestamp_ns > 0 ? ""
                           : "its header has no stamp; let the driver set it";
}

inline std::string ConvertRosMessage(const sensor_msgs::Imu& message,
                                     ImuSample* sample) {
  const std::string cause =
      ConvertRosStamp(message.header.stamp, &sample->timestamp_ns);
  if (!cause.empty()) return cause;
  const auto& rate = message.angular_velocity;
  const auto& force = message.linear_acceleration;
  sample->angular_velocity << rate.x, rate.y, rate.z;
  sample->specific_force << force.x, force.y, force.z;
  const bool is_finite = sample->angular_velocity.allFinite() &&
                         sample->specific_force.allFinite();
  return is_finite ? "" : "its rates or accelerations are not finite";
}

inline std::string ConvertRosMessage(const nav_msgs::Odometry& message,
                                     OdometryPose* pose) {
  const std::string cause =
      ConvertRosStamp(message.header.stamp, &pose->timestamp_ns);
  if (!cause.empty()) return cause;
  const auto& q = message.pose.pose.orientation;
  const auto& p = message.pose.pose.position;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  const Eigen::Vector3d position(p.x, p.y, p.z);
  // Also false for what is not a number.
  const bool is_unit = std::abs(rotation.norm() - 1.0) < 0.01;
  if (!is_unit) return "the length of its quaternion is not 1";
  if (!position.allFinite()) return "its position is not finite";
  pose->world_from_body = Rigid3d(rotation.normalized(), position);
  return "";
}

}  // namespace adasfm
