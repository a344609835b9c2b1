// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/estimate_priors.h"

namespace adasfm {

bool PriorEstimationOptions::IsValid(std::string* error) const {
  const std::pair<const char*, double> positive[] = {
      {"max_imu_gap_s", max_imu_gap_s},
      {"max_wheel_gap_s", max_wheel_gap_s},
      {"max_link_s", max_link_s},
      {"visual_bias_sigma", visual_bias_sigma}};
  for (const auto& [name, value] : positive) {
    if (value > 0.0) continue;
    *error = "AdaSfmPriors." + std::string(name) + " is " +
             std::to_string(value) + "; it must be positive";
    return false;
  }
  if (!(max_lead_s >= 0.0)) {
    *error = "AdaSfmPriors.max_lead_s must not be negative";
    return false;
  }
  if (estimate_time_shift < -1 || estimate_time_shift > 1) {
    *error = "AdaSfmPriors.estimate_time_shift is " +
             std::to_string(estimate_time_shift) + "; it must be -1, 0 or 1";
    return false;
  }
  return fusion.IsValid(error);
}

}  // namespace adasfm
