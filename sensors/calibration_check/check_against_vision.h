// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "core/types.h"
#include "sensors/calibration_check/gyroscope_filter.h"
#include "sensors/io/calibration.h"

namespace adasfm {

// A rotation seen by the cameras between two times of the camera's clock.
struct TimedRotation {
  timestamp_t start_ns = 0;
  timestamp_t end_ns = 0;
  Eigen::Quaterniond cam2_from_cam1 = Eigen::Quaterniond::Identity();
  double weight = 1.0;
};

// Correlation of all axes from which an explanation counts as agreeing.
inline constexpr double kMinAgreeingCorrelation = 0.8;
// A time shift beyond this is a contradiction unless it is to be estimated.
inline constexpr double kMaxAcceptedShiftS = 0.03;

// Medians over intervals of one to two frames, of the lengths of rotation
// vectors (unexplained_rotation.h).
struct UnexplainedRotation {
  bool is_conclusive = false;
  // Rotation of the gyroscope about its median, the residual of vision that no
  // time shift and no extrinsic rotation explains, and the error of vision
  // itself.
  double turning_deg = 0.0;
  double residual_deg = 0.0;
  double visual_error_deg = 0.0;
  // Rotation of vision about its median, and the residual when the gyroscope
  // may also have any scale.
  double visual_turning_deg = 0.0;
  double scaled_residual_deg = 0.0;
  // 1 sigma of the time between two images that explains the residual:
  // rotations err by this times the angular rate when image times jitter or
  // rows are exposed one after another. 0 where the noise of vision and
  // gyroscope explains the residual, or not even 0.03 s do.
  double interval_time_sigma_s = 0.0;
};

struct VisionCheck {
  // False: too little rotation for a conclusion; nothing else is set.
  bool is_conclusive = false;
  // Of rotation vectors, as calibrated.
  double total_correlation = 0.0;
  // To be added to timeshift_cam_imu_s; sub-frame.
  double time_shift_correction_s = 0.0;
  double shifted_correlation = 0.0;
  // rad/s, IMU frame, with its mean 1 sigma of an axis (visual_bias.h).
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();
  double gyroscope_bias_sigma = 0.0;
  // On the IMU's clock as shifted by the correction above; without a lag unless
  // vision is clearly better explained with one.
  GyroscopeFilter filter;
  // The only mistake is the time shift.
  bool contradiction_is_time_shift = false;
  // The time shift is clear from vision, and within the range of a clock
  // offset.
  bool is_clock_shift = false;
  UnexplainedRotation unexplained;
  // Gyroscope and pictures show different motions, which no calibration mends:
  // a video stabilised in the camera.
  bool contradiction_is_motion = false;
  // Empty when vision and gyroscope agree; else one line that names the
  // mistake and what to do.
  std::string contradiction;
};

// Hand-eye check: compares the gyroscope's rotations, in the camera frame, with
// the cameras' own.
VisionCheck CheckAgainstVision(const std::vector<TimedRotation>& rotations,
                               const std::vector<ImuSample>& imu,
                               const SensorCalibration& calibration);

}  // namespace adasfm
