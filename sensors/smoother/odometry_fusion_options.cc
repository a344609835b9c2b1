// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

bool OdometryFusionOptions::IsValid(std::string* error) const {
  const std::pair<const char*, double> positive[] = {
      {"gravity_m_s2", gravity_m_s2},
      {"gyroscope_bias_sigma", gyroscope_bias_sigma},
      {"accelerometer_bias_sigma", accelerometer_bias_sigma},
      {"wheel_scale_sigma", wheel_scale_sigma},
      {"wheel_track_sigma", wheel_track_sigma},
      {"wheel_curvature_sigma", wheel_curvature_sigma},
      {"wheel_delay_sigma_s", wheel_delay_sigma_s},
      {"lateral_speed_noise", lateral_speed_noise},
      {"vertical_speed_noise", vertical_speed_noise},
      {"planar_rotation_noise", planar_rotation_noise},
      {"slip_threshold_sigma", slip_threshold_sigma},
      {"vision_threshold_sigma", vision_threshold_sigma},
      {"visual_turn_sigma", visual_turn_sigma},
      {"standstill_speed_sigma", standstill_speed_sigma},
      {"standstill_rate_sigma", standstill_rate_sigma},
      {"unaided_speed_sigma", unaided_speed_sigma},
      {"max_num_iterations", static_cast<double>(max_num_iterations)}};
  for (const auto& [name, value] : positive) {
    if (value > 0.0) continue;
    *error = "AdaSfmPriors." + std::string(name) + " is " +
             std::to_string(value) + "; it must be positive";
    return false;
  }
  if (!(wheel_mount_sigma_deg >= 0.0) || !(slip_min_speed_m_s >= 0.0)) {
    *error =
        "AdaSfmPriors.wheel_mount_sigma_deg and .slip_min_speed_m_s must "
        "not be negative";
    return false;
  }
  return true;
}

}  // namespace adasfm
