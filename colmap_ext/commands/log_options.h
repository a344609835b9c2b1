// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/commands/command.h"

namespace adasfm {

// --image_times_path, --imu_path, --wheel_path and --gnss_path, for every
// command that reads logs. Paths has members of these names.
template <typename Paths>
void AddLogOptions(Paths* paths, CommandOptions* command) {
  command->AddDefault(
      "image_times_path", &paths->image_times_path,
      "image times: EuRoC data.csv, 4Seasons times.txt or TUM rgb.txt; when "
      "empty, the digits of an image name are its nanoseconds");
  command->AddDefault(
      "imu_path", &paths->imu_path,
      "IMU log: EuRoC CSV, 4Seasons imu.txt, a KITTI oxts folder "
      "or a ROS bag; none when empty");
  command->AddDefault("wheel_path", &paths->wheel_path,
                      "wheel log (the header line identifies the type), a TUM "
                      "odometry trajectory or a ROS bag; none when empty");
  command->AddDefault(
      "gnss_path", &paths->gnss_path,
      "GNSS positions: CSV whose header names the columns, NMEA, a KITTI oxts "
      "folder, a ROS bag, or 'database' for positions that COLMAP stored (EXIF "
      "or pose_priors); none when empty");
}

// --imu_topic, --wheel_topic and --gnss_topic, for commands that read bags.
// Names has members imu, wheel and gnss.
template <typename Names>
void AddBagTopicOptions(Names* names, CommandOptions* command) {
  command->AddDefault(
      "imu_topic", &names->imu,
      "IMU topic of the bag; when empty, the only IMU topic; 'none': no IMU");
  command->AddDefault("wheel_topic", &names->wheel,
                      "topic of odometry, twists or joint states in the bag; "
                      "when empty, the only such topic; 'none': no wheels");
  command->AddDefault("gnss_topic", &names->gnss,
                      "topic of GNSS positions in the bag; when empty, the "
                      "only such topic; 'none': no GNSS");
}

}  // namespace adasfm
