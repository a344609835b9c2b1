// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/odometry_fusion_options.h"

#include "core/option_checker.h"

namespace adasfm {

bool OdometryFusionOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmPriors", error)
      .Positive({{"gravity_m_s2", gravity_m_s2},
                 {"gyroscope_bias_sigma_rad_s", gyroscope_bias_sigma},
                 {"accelerometer_bias_sigma_m_s2", accelerometer_bias_sigma},
                 {"wheel_scale_sigma", wheel_scale_sigma},
                 {"wheel_track_sigma", wheel_track_sigma},
                 {"wheel_curvature_sigma_per_m", wheel_curvature_sigma},
                 {"wheel_delay_sigma_s", wheel_delay_sigma_s},
                 {"lateral_speed_noise_m_s_sqrt_hz", lateral_speed_noise},
                 {"vertical_speed_noise_m_s_sqrt_hz", vertical_speed_noise},
                 {"planar_rotation_noise_rad_sqrt_s", planar_rotation_noise},
                 {"slip_threshold_sigma", slip_threshold_sigma},
                 {"standstill_speed_sigma_m_s", standstill_speed_sigma},
                 {"standstill_rate_sigma_rad_s", standstill_rate_sigma},
                 {"unaided_speed_sigma_m_s", unaided_speed_sigma}})
      .NotNegative(
          {{"driving_direction_sigma_deg", driving_direction_sigma_deg},
           {"slip_min_speed_m_s", slip_min_speed_m_s}})
      .AtLeast(1, "max_num_iterations", max_num_iterations)
      .AllHold();
}

}  // namespace adasfm
