// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/shared_errors.h"

#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {

bool SharedErrorOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .NotNegative(
          {{"gyroscope_random_walk_rad_s_sqrt_s",
            gyroscope_random_walk_rad_s_sqrt_s},
           {"extrinsic_rotation_sigma_rad", extrinsic_rotation_sigma_rad},
           {"driving_direction_sigma_rad", driving_direction_sigma_rad},
           {"direction_drift_time_s", direction_drift_time_s},
           {"length_drift_ratio", length_drift_ratio}})
      .Positive("gyroscope_window_s", gyroscope_window_s)
      .AllHold();
}

Eigen::Matrix3d CameraFromMiddle(const Eigen::Quaterniond& cam2_from_cam1) {
  return ExpSo3(0.5 * LogSo3(cam2_from_cam1)).toRotationMatrix();
}

namespace {

template <typename Value>
Value ValueOr(const Value& fallback, const std::map<int, Value>& values,
              int key) {
  const auto found = values.find(key);
  return found == values.end() ? fallback : found->second;
}

}  // namespace

Rigid3d SharedErrors::Correct(const Rigid3d& cam2_from_cam1, double dt_s,
                              const SharedErrorWindows& windows) const {
  const Eigen::Quaterniond& rotation = cam2_from_cam1.rotation;
  const Eigen::Matrix3d from_middle = CameraFromMiddle(rotation);
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::Vector3d extrinsic =
      ValueOr(zero, extrinsic_rotation, windows.drive);
  const Eigen::Vector3d error =
      extrinsic - rotation * extrinsic +
      LogSo3(rotation).cwiseProduct(
          ValueOr(zero, gyroscope_scale, windows.drive)) +
      dt_s * (from_middle * ValueOr(zero, gyroscope_bias, windows.gyroscope)) +
      ValueOr(0.0, time_shift, windows.drive) * windows.rotation_by_time_shift;
  const Eigen::Vector3d drift =
      ValueOr(zero, direction_drift, windows.direction);
  const Eigen::Vector3d direction =
      ValueOr(zero, driving_direction, windows.drive) + drift;
  const Eigen::Vector3d& stated = cam2_from_cam1.translation;
  const Eigen::Vector3d translation =
      stated * (1.0 + ValueOr(0.0, length_scale, windows.drive) +
                windows.length_per_direction *
                    stated.normalized().dot(from_middle * drift));
  return Rigid3d((ExpSo3(error) * rotation).normalized(),
                 ExpSo3(from_middle * direction) * translation);
}

}  // namespace adasfm
