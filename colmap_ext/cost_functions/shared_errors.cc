// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/shared_errors.h"

#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {

bool SharedErrorOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .NotNegative(
          {{"gyroscope_bias_sigma_rad_s", gyroscope_bias_sigma_rad_s},
           {"gyroscope_random_walk_rad_s_sqrt_s",
            gyroscope_random_walk_rad_s_sqrt_s},
           {"extrinsic_rotation_sigma_rad", extrinsic_rotation_sigma_rad},
           {"driving_direction_sigma_rad", driving_direction_sigma_rad},
           {"direction_drift_time_s", direction_drift_time_s},
           {"length_drift_ratio", length_drift_ratio}})
      .Positive({{"gyroscope_window_s", gyroscope_window_s},
                 {"direction_window_s", direction_window_s}})
      .AllHold();
}

Eigen::Matrix3d CameraFromMiddle(const Eigen::Quaterniond& cam2_from_cam1) {
  return ExpSo3(0.5 * LogSo3(cam2_from_cam1)).toRotationMatrix();
}

Rigid3d SharedErrors::Correct(const Rigid3d& cam2_from_cam1, double dt_s,
                              const SharedErrorWindows& windows) const {
  const Eigen::Quaterniond& rotation = cam2_from_cam1.rotation;
  const Eigen::Matrix3d from_middle = CameraFromMiddle(rotation);
  Eigen::Vector3d error = extrinsic_rotation - rotation * extrinsic_rotation;
  const auto bias = gyroscope_bias.find(windows.gyroscope);
  if (bias != gyroscope_bias.end()) {
    error += dt_s * (from_middle * bias->second);
  }
  Eigen::Vector3d direction = driving_direction;
  Eigen::Vector3d translation = cam2_from_cam1.translation;
  const auto drift = direction_drift.find(windows.direction);
  if (drift != direction_drift.end()) {
    direction += drift->second;
    translation *=
        1.0 + windows.length_per_direction *
                  translation.normalized().dot(from_middle * drift->second);
  }
  return Rigid3d((ExpSo3(error) * rotation).normalized(),
                 ExpSo3(from_middle * direction) * translation);
}

}  // namespace adasfm
