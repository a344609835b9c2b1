// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "core/sensor_log.h"

namespace adasfm {

enum class SyntheticCameraModel { kPinhole, kFisheye };

enum class SyntheticTrajectory { kTown, kStraight, kParallel, kFloors, kLanes };

// Of the wheel log.
inline constexpr double kSyntheticWheelRateHz = 50.0;

// A drive through streets with facades. One generator serves the tests, the
// benchmarks and the demo; equal options give equal worlds.
struct SyntheticWorldOptions {
  // Of each camera.
  int num_images = 100;
  uint64_t seed = 1;
  // Mean distance between images along the path.
  double spacing_m = 1.5;
  // Mean time between images under way; 0: that of 8 m/s (kLanes: 1 m/s),
  // within 0.05 to 0.4 s.
  double image_interval_s = 0.0;
  // kTown drives blocks with right-angle bends and returns to places seen
  // before; kStraight is one street; kParallel goes up and down parallel
  // streets that look alike; kFloors climbs the floors of a car park that look
  // alike; kLanes goes back and forth on a lawn, as a mower does.
  SyntheticTrajectory trajectory = SyntheticTrajectory::kTown;
  // kParallel: blocks of 60 m of each street.
  int street_num_blocks = 3;
  // kFloors: height from floor to floor.
  double floor_height_m = 3.0;
  // kLanes.
  double lane_spacing_m = 1.0;
  double lane_length_m = 20.0;
  // Stops under way, and turns by 360 deg on the spot. Images are still taken
  // at even times, so that the distance driven becomes shorter.
  int num_stops = 0;
  double stop_duration_s = 10.0;
  // Above 0: the time between images at rest. The drive then takes longer by
  // the stops, which may last for hours.
  double stop_image_interval_s = 0.0;
  int num_spins = 0;
  double spin_duration_s = 8.0;
  SyntheticCameraModel camera_model = SyntheticCameraModel::kPinhole;
  // Above 0, a second camera takes its images at the same times, this far to
  // the right of the first one.
  double stereo_baseline_m = 0.0;

  // The focal length follows the width.
  int image_width = 800;
  int image_height = 500;
  int num_keypoints_per_image = 300;
  double pixel_noise_px = 0.5;
  // Time from the first to the last row of an image; 0: global shutter. The
  // pose is that of the middle row.
  double rolling_shutter_s = 0.0;
  // Share of an image's keypoints that lie on two cars that drive ahead.
  double moving_keypoint_ratio = 0.0;
  // Autofocus: the largest error of a photo's focal length, as a share of the
  // camera's. The error is a slow wave in time or, with num_focal_steps,
  // constant between this many changes.
  double focal_breathing_ratio = 0.0;
  int num_focal_steps = 0;
  // The following three affect photos only. Automatic exposure: the share of
  // photos that are darker or brighter than the previous one by
  // exposure_jump_factor.
  double exposure_jump_ratio = 0.0;
  double exposure_jump_factor = 2.0;
  // Motion blur: how long the shutter is open; the pose is that of the middle.
  double exposure_time_s = 0.0;
  // Share of raw matches that are wrong at random (verification rejects most).
  double outlier_match_ratio = 0.2;
  // Images up to this distance in the sequence are matched, as well as images
  // of the same place on another visit.
  int num_sequential_neighbors = 10;
  // Share of verified pairs that are aliased: mutually consistent wrong matches
  // of repeated facades.
  double alias_pair_ratio = 0.0;
  // Share of verified pairs that join images with nothing in common, by a few
  // matches that fit some epipolar geometry by chance.
  double spurious_pair_ratio = 0.0;
  // Share of the true pairs whose rotation is off by 15 to 90 deg.
  double rotation_outlier_ratio = 0.0;
  // Intervals without texture: their number, their length in images and the
  // largest number of keypoints of their images.
  int num_blackouts = 0;
  int blackout_num_images = 16;
  int blackout_num_keypoints = 0;

  double imu_rate_hz = 200.0;
  ImuNoise imu_noise = {5e-4, 2e-5, 5e-3, 2e-4};
  // The biases at the start are drawn with these, rad/s and m/s^2 per axis.
  double gyro_bias_sigma = 0.003;
  double accel_bias_sigma = 0.03;
  double wheel_speed_noise = 0.05;  // m/s, 1 sigma per sample
  // True speed = wheel_scale * logged speed.
  double wheel_scale = 1.0;
  // Intervals in which the wheels slip and log more than the distance driven.
  int num_wheel_slips = 0;
  // Gravel: each wheel's slip, 1 sigma as a share of its speed, with a
  // correlation time of 1 s. Not part of the calibration.
  double wheel_slip_sigma = 0.0;
  // Growth of the gyroscope's bias about the vertical, rad/s per s. Not part of
  // the calibration.
  double gyro_drift = 0.0;
  // By this share the gyroscope's rates are too large. Not part of the
  // calibration.
  double gyro_scale = 0.0;
  // Positions of a receiver; 0: none. White noise per axis, and intervals of 5
  // s in which they are 15 m off.
  double gnss_rate_hz = 0.0;
  double gnss_noise_m = 1.0;
  int num_gnss_jumps = 0;
  // Seconds at rest before the car sets off (the first image follows a second
  // later); 0: the log begins at full speed.
  double standstill_s = 3.0;
  // t_imu = t_cam + shift.
  double timeshift_cam_imu_s = 0.0;

  bool IsValid(std::string* error) const;
};

}  // namespace adasfm
