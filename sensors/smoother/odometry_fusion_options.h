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
  // Prior sigma of the delay of the wheels' readings behind the motion, s: half
  // of the log's period where a speed is a difference of counts, and the time
  // on a bus.
  double wheel_delay_sigma_s = 0.03;
  // Noise of the lateral and vertical speed of the wheel frame, m/s/sqrt(Hz).
  // Vertical is larger: springs, and slopes that T_imu_wheel does not follow.
  double lateral_speed_noise = 0.05;
  double vertical_speed_noise = 0.2;
  // Roll and pitch of a machine without IMU, rad/sqrt(s).
  double planar_rotation_noise = 0.03;
  // A link whose wheels differ from the IMU by more sigmas than this loses
  // weight.
  double slip_threshold_sigma = 4.0;
  // Reported as a slip when the speed error also exceeds this.
  double slip_min_speed_m_s = 0.2;
  // Sigmas of the motion of a machine at rest. The rate is one unknown of a
  // whole standstill, so its sigma does not shrink with the duration.
  double standstill_speed_sigma = 0.005;  // m/s
  double standstill_rate_sigma = 1e-4;    // rad/s
  // Sigma of the speed of an IMU without wheels: its only bound.
  double unaided_speed_sigma = 15.0;  // m/s
  // Weights of slipping wheels converge slowly; most drives take 15 iterations.
  int max_num_iterations = 100;

  bool IsValid(std::string* error) const;
};

}  // namespace adasfm
