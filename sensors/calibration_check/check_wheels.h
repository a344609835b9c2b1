// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <complex>
#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

// How the wheels' motion fits the IMU's over windows of 0.4 s.
struct WheelFit {
  int num_windows = 0;
  // Slipping windows have low weights (FitWheels).
  double sum_of_weights = 0.0;
  // True horizontal acceleration per logged one, as a complex number in the
  // wheel frame's plane: 1 when all is right, 1 / 3.6 for km/h, -1 for wheels
  // that count backwards; and its correlation.
  std::complex<double> force = 0.0;
  double force_correlation = 0.0;
  // The same against the mirrored acceleration (accelerometer with x and y
  // exchanged).
  double mirrored_correlation = 0.0;
  // Logged yaw rate per gyroscope's, and its correlation.
  double yaw = 0.0;
  double yaw_correlation = 0.0;
  // Excitation: rms of the logged acceleration, m/s^2, and of the gyroscope's
  // yaw rate, rad/s.
  double acceleration_rms = 0.0;
  double yaw_rate_rms = 0.0;
  // Correlation of the forward acceleration alone.
  double forward_correlation = 0.0;
};

struct WheelCheck {
  WheelFit fit;  // at the clocks as logged
  // Mean specific force in the wheel frame, whose z axis is up.
  Eigen::Vector3d mean_force = Eigen::Vector3d::Zero();
  // One line that names the mistake and what to do; empty when there is none.
  std::string contradiction;
  // Findings that do not prevent the estimate.
  std::vector<std::string> warnings;
};

// Checks accelerometer, gyroscope and wheels against each other. Inputs: logs
// in order of time on one clock, speeds of the wheel frame (x forward, y left,
// z up), the calibration; has_yaw: the wheels observe the yaw.
//
// Over windows the mean specific force must be gravity upwards plus (dv/dt, v
// w_z) of the speeds v and the gyroscope's w_z, and the wheels' yaw rate must
// be w_z. The mean force shows the accelerometer's sign and axes. One complex
// regression of the horizontal force shows the wheels' unit, sign and
// direction. Correlations over shifts of up to 10 s show the clock, and whether
// the logs belong to one drive: logs of another drive fit no better at their
// own clock than at others. The first cause without doubt is named, in the
// order gravity, clock, drive, axes, direction, unit. Too little motion gives
// an empty result.
WheelCheck CheckWheels(const std::vector<ImuSample>& imu,
                       const std::vector<WheelSpeed>& speeds, bool has_yaw,
                       const SensorCalibration& calibration);

}  // namespace adasfm
