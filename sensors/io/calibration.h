// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/io/read_gnss.h"

namespace adasfm {

// Extrinsics and noise of the sensors (docs/reference/sensors.md). Body frame =
// IMU frame; wheel frame: x forward, y left, z up.
struct SensorCalibration {
  Rigid3d cam_from_imu;
  // cam1, cam2, ... of a rig; their clock is cam0's.
  std::vector<Rigid3d> other_cams_from_imu;
  // t_imu = t_cam + shift; the wheel log runs on the IMU's clock.
  double timeshift_cam_imu_s = 0.0;

  bool has_imu = false;
  ImuNoise imu_noise;
  double imu_rate_hz = 200.0;

  bool has_wheel = false;
  WheelType wheel_type = WheelType::kDifferential;
  double track_width_m = 1.0;
  double metres_per_tick = 0.0;
  double wheelbase_m = 1.0;            // rear to front axle, of kSteering
  double wheel_speed_noise = 0.05;     // m/s, 1 sigma of one sample
  double wheel_yaw_rate_noise = 0.02;  // rad/s, 1 sigma of one sample
  Rigid3d imu_from_wheel;

  bool has_gnss = false;
  GnssNoise gnss_noise;
  // The antenna's phase centre in the IMU frame, m.
  Eigen::Vector3d antenna_in_imu = Eigen::Vector3d::Zero();
  // t_imu = t_gnss + shift.
  double timeshift_gnss_imu_s = 0.0;
};

// Reads the YAML file of docs/reference/sensors.md (Kalibr's keys). Every error
// is one line that names the file, the key and what to do.
StatusOr<SensorCalibration> ReadSensorCalibration(const std::string& path);

}  // namespace adasfm
