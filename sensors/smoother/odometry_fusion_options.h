// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace adasfm {

struct OdometryFusionOptions {
  // Gravity varies by 0.5 %; the accelerometer bias absorbs the difference.
  double gravity_m_s2 = 9.81;
  // Prior sigmas of the biases: MEMS with a factory calibration.
  double gyroscope_bias_sigma = 0.005;    // rad/s
  double accelerometer_bias_sigma = 0.3;  // m/s^2
  // Prior sigma of the wheels' scale: tyres wear, loads change.
  double wheel_scale_sigma = 0.01;
  // Prior sigmas of the effective track width, as a ratio (skid steering
  // changes it much), and of the difference of the wheels, as a curvature in
  // 1/m.
  double wheel_track_sigma = 0.1;
  double wheel_curvature_sigma = 0.01;
  // Prior sigma of the driving direction relative to T_imu_wheel: extrinsics
  // are rarely measured better. 0 trusts T_imu_wheel.
  double driving_direction_sigma_deg = 2.0;

  bool IsValid(std::string* error) const;
};

}  // namespace adasfm
