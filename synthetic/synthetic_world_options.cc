// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/synthetic_world_options.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/option_checker.h"

namespace adasfm {

bool SyntheticWorldOptions::IsValid(std::string* error) const {
  OptionChecker checker(error);
  const int max_num_blackouts =
      num_images / 2 / std::max(1, blackout_num_images);
  checker.AtLeast(2, "num_images", num_images)
      .AtLeast(64, "image_width", image_width)
      .AtLeast(64, "image_height", image_height)
      .Positive({{"spacing_m", spacing_m},
                 {"num_keypoints_per_image", num_keypoints_per_image},
                 {"street_num_blocks", street_num_blocks},
                 {"lane_spacing_m", lane_spacing_m},
                 {"stop_duration_s", stop_duration_s},
                 {"num_sequential_neighbors", num_sequential_neighbors},
                 {"blackout_num_images", blackout_num_images},
                 {"imu_rate_hz", imu_rate_hz},
                 {"wheel_scale", wheel_scale}})
      .NotNegative(
          {{"stereo_baseline_m", stereo_baseline_m},
           {"image_interval_s", image_interval_s},
           {"pixel_noise_px", pixel_noise_px},
           {"num_stops", num_stops},
           {"stop_image_interval_s", stop_image_interval_s},
           {"num_spins", num_spins},
           {"num_focal_steps", num_focal_steps},
           {"blackout_num_keypoints", blackout_num_keypoints},
           {"num_blackouts", num_blackouts},
           {"gyroscope_noise_density", imu_noise.gyroscope_noise_density},
           {"gyroscope_random_walk", imu_noise.gyroscope_random_walk},
           {"accelerometer_noise_density",
            imu_noise.accelerometer_noise_density},
           {"accelerometer_random_walk", imu_noise.accelerometer_random_walk},
           {"gyro_bias_sigma", gyro_bias_sigma},
           {"accel_bias_sigma", accel_bias_sigma},
           {"wheel_speed_noise", wheel_speed_noise},
           {"num_wheel_slips", num_wheel_slips},
           {"gnss_rate_hz", gnss_rate_hz},
           {"gnss_noise_m", gnss_noise_m},
           {"num_gnss_jumps", num_gnss_jumps},
           {"standstill_s", standstill_s}})
      .Within(2.5, 6.0, "floor_height_m", floor_height_m)
      .AtLeast(4.0 * lane_spacing_m, "lane_length_m", lane_length_m)
      .AtLeast(2.0, "spin_duration_s", spin_duration_s)
      .Within(0.0, 0.1, "rolling_shutter_s", rolling_shutter_s)
      .Within(0.0, 0.1, "exposure_time_s", exposure_time_s)
      .Within(1.1, 16.0, "exposure_jump_factor", exposure_jump_factor)
      .Within(0.0, 0.2, "focal_breathing_ratio", focal_breathing_ratio)
      .Within(0.0, 0.5, "wheel_slip_sigma", wheel_slip_sigma)
      .Within(-1e6, 1e6, "gyro_drift", gyro_drift)
      .Within(-0.1, 0.1, "gyro_scale", gyro_scale)
      .Within(-1e6, 1e6, "timeshift_cam_imu_s", timeshift_cam_imu_s)
      .Require(num_blackouts <= max_num_blackouts, "num_blackouts",
               num_blackouts,
               "must be at most " + std::to_string(max_num_blackouts) +
                   ": half of the images keep their texture")
      .Require(num_stops > 0 || stop_image_interval_s == 0.0,
               "stop_image_interval_s", stop_image_interval_s,
               "must be 0 without stops")
      .Require(num_spins == 0 || stop_image_interval_s == 0.0, "num_spins",
               num_spins, "must be 0 with stop_image_interval_s")
      .Require(num_focal_steps < num_images, "num_focal_steps", num_focal_steps,
               "must be less than num_images");
  const std::pair<const char*, double> shares[] = {
      {"outlier_match_ratio", outlier_match_ratio},
      {"moving_keypoint_ratio", moving_keypoint_ratio},
      {"alias_pair_ratio", alias_pair_ratio},
      {"spurious_pair_ratio", spurious_pair_ratio},
      {"rotation_outlier_ratio", rotation_outlier_ratio},
      {"alias_pair_ratio + spurious_pair_ratio",
       alias_pair_ratio + spurious_pair_ratio}};
  for (const auto& [name, value] : shares) checker.Within(0, 0.9, name, value);
  checker.Within(0, 1, "exposure_jump_ratio", exposure_jump_ratio);
  return checker.AllHold();
}

}  // namespace adasfm
