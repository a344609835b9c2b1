// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"

namespace adasfm {

// ROS 1 bags. A path is "drive.bag", or "drive.bag:/topic" where the bag holds
// several topics of the message's type. Messages are put in the order of their
// header's stamps. Needs a build with librosbag-storage
// (docs/guide/install.md); without it reading is an error that says so.

// Whether the path names a bag.
bool IsRosbagPath(const std::string& path);

// Whether this build reads bags.
bool CanReadRosbags();

// sensor_msgs/Imu: angular_velocity [rad/s] and linear_acceleration [m/s^2],
// which is specific force. Values are not checked.
StatusOr<std::vector<ImuSample>> ReadRosbagImu(const std::string& path);

// nav_msgs/Odometry: pose.pose as world_from_body. Errors name messages without
// a usable rotation.
StatusOr<std::vector<OdometryPose>> ReadRosbagOdometry(const std::string& path);

}  // namespace adasfm
