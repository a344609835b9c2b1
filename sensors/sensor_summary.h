// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Figures for the screen and the JSON summary; zero where there is no sensor.
struct SensorSummary {
  int num_images = 0;
  int num_images_in_logs = 0;
  int num_priors = 0;
  double prior_ratio = 0.0;  // of the consecutive pairs
  double imu_rate_hz = 0.0;
  double wheel_rate_hz = 0.0;
  int num_imu_gaps = 0;
  int num_wheel_gaps = 0;
  double max_imu_gap_s = 0.0;
  double max_wheel_gap_s = 0.0;
  double standstill_s = 0.0;
  // Means over the sequence, with the mean 1 sigma of an axis: rad/s, m/s^2, in
  // the body (IMU) frame.
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();
  double gyroscope_bias_sigma = 0.0;
  Eigen::Vector3d accelerometer_bias = Eigen::Vector3d::Zero();
  double accelerometer_bias_sigma = 0.0;
  // Covariance of the gyroscope's bias (rad^2/s^2), body (IMU) frame. Without
  // an IMU that of the rate error that the wheels' links share
  // (OdometryFusionResult).
  Eigen::Matrix3d gyroscope_bias_covariance = Eigen::Matrix3d::Zero();
  // Noise in use over the stated one, as the logs show it.
  double gyroscope_noise_factor = 1.0;
  double accelerometer_noise_factor = 1.0;
  double wheel_speed_noise_factor = 1.0;
  double wheel_yaw_noise_factor = 1.0;
  // Of the wheels' speed, see OdometryFusionProblem.
  double wheel_persistence = 1.0;
  // 1 sigma of the error that neighbouring motions' lengths share, as a ratio;
  // 0 where the wheels' errors do not persist.
  double length_drift_ratio = 0.0;
  // At the first image in the logs, in its camera frame; zero when unknown.
  Eigen::Vector3d first_gravity_in_cam = Eigen::Vector3d::Zero();
  // True speed = scale * logged speed.
  double wheel_scale = 1.0;
  double wheel_scale_sigma = 0.0;
  // Driving direction relative to T_imu_wheel: to the left and down.
  Eigen::Vector2d driving_direction_deg = Eigen::Vector2d::Zero();
  Eigen::Vector2d driving_direction_sigma_deg = Eigen::Vector2d::Zero();
  // The time shift in use, the correction of the calibration's time shift by
  // vision (0 when unknown), and whether the correction was applied.
  double timeshift_cam_imu_s = 0.0;
  double visual_timeshift_correction_s = 0.0;
  bool timeshift_was_corrected = false;
  // Delay of the wheels' readings behind the motion, estimated by the smoother.
  double wheel_delay_s = 0.0;
  double wheel_delay_sigma_s = 0.0;
  // What was added to the times of the wheels.
  double wheel_clock_shift_s = 0.0;
  // Vision against the gyroscope, and whether the IMU was left out because of
  // it.
  UnexplainedRotation unexplained_rotation;
  bool imu_was_left_out = false;
  // The low-pass filter that was undone (see GyroscopeFilter); 0: none.
  double gyroscope_lag_s = 0.0;
  double gyroscope_delay_s = 0.0;
  std::vector<WheelSlip> wheel_slips;  // camera clock
  double distance_m = 0.0;
  // Expected error of the chained priors after 100 m, 1 sigma.
  double drift_per_100m_m = 0.0;
  double drift_per_100m_deg = 0.0;
  std::vector<std::string> warnings;
};

// Rates and gaps of the logs.
void SummarizeRates(const MotionLogs& logs, SensorSummary* summary);

// Biases, scale, driving direction, distance and standstill as the smoother
// estimated them, and a warning when the smoother did not converge.
void SummarizeFusion(const OdometryFusionProblem& problem,
                     const OdometryFusionResult& fused, const MotionLogs& logs,
                     SensorSummary* summary);

// Slips between the first and the last image, on the camera's clock.
std::vector<WheelSlip> ListWheelSlips(const OdometryFusionResult& fused,
                                      const OdometryTimeline& timeline,
                                      timestamp_t timeshift_ns);

// Predicts the drift over 100 m at the mean speed; needs distance, bias and
// scale of the summary. The heading errs by the gyroscope's noise and bias
// sigma, the position by the scale and half of the final heading error (its
// mean over the path).
void PredictDrift(const OdometryFusionProblem& problem, bool has_imu,
                  SensorSummary* summary);

}  // namespace adasfm
