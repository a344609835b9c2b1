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
                 {"wheel_curvature_sigma_per_m", wheel_curvature_sigma}})
      .NotNegative(
          {{"driving_direction_sigma_deg", driving_direction_sigma_deg}})
      .AllHold();
}

}  // namespace adasfm
