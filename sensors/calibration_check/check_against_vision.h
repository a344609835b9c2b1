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

struct VisionCheckOptions {
  // Time shifts tried about the calibration's.
  double max_time_shift_s = 2.0;
  // Below this the cameras hardly turn and nothing can be said.
  double min_rotation_rms_deg = 0.15;
  // Cameras that turn this much and fit the gyroscope in no way contradict it;
  // below it may be the noise of two-view geometries.
  double min_contradicting_rms_deg = 1.0;
  int min_num_rotations = 10;
  // Correlation from which axes count as agreeing, and below which, when
  // other axes agree, the calibration is refused.
  double min_correlation = 0.8;
  // A shift beyond this is refused unless it is to be estimated.
  double max_accepted_shift_s = 0.03;
  // A shift up to this is a clock's, and may be corrected without asking:
  // exposure, readout and the driver's delay make tens of milliseconds. Beyond
  // it another mistake is likelier.
  double max_clock_shift_s = 0.15;
  // Smaller ones are left: a filter in the gyroscope is as likely a cause (of
  // three KITTI drives on one clock, two seem to be off by 4 and 9 ms).
  double min_clock_shift_s = 0.01;
  // A gyroscope that leaves this share of the turning unexplained is that of
  // another motion than the pictures',
  double max_unexplained_ratio = 0.5;
  // if vision itself errs by no more than this share of what is left.
  double max_visual_error_ratio = 0.33;

  bool IsValid(std::string* error) const;
};

// Medians over intervals of one to two frames, of the lengths of rotation
// vectors (unexplained_rotation.h).
struct UnexplainedRotation {
  bool is_conclusive = false;
  // Of the gyroscope about its mean, what no clock and no mounting explains of
  // vision, and what vision errs by itself.
  double turning_deg = 0.0;
  double residual_deg = 0.0;
  double visual_error_deg = 0.0;
  // Of vision about its mean, and what is left when the gyroscope may have any
  // scale too.
  double visual_turning_deg = 0.0;
  double scaled_residual_deg = 0.0;
  // 1 sigma of the time between two images that makes up for the rest: photos
  // whose times jitter, or whose rows are exposed one after another, turn by it
  // times the turning rate. 0 where vision's and the gyroscope's noise explain
  // the rest.
  double interval_time_sigma_s = 0.0;
};

struct VisionCheck {
  // False: too little turning to say anything; nothing else is set.
  bool is_conclusive = false;
  // Of rotation vectors, in the camera frame, as calibrated.
  Eigen::Vector3d correlation = Eigen::Vector3d::Zero();
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
  // That time shift is clear from vision, and small enough for a clock's.
  bool is_clock_shift = false;
  UnexplainedRotation unexplained;
  // Gyroscope and pictures show different motions, which no calibration mends:
  // a video stabilised in the camera.
  bool contradiction_is_motion = false;
  // Empty when vision and gyroscope agree; else one line that names the
  // mistake and what to do.
  std::string contradiction;
};

// Hand-eye check: the gyroscope's rotations, moved into the camera frame,
// against the cameras' own.
VisionCheck CheckAgainstVision(const std::vector<TimedRotation>& rotations,
                               const std::vector<ImuSample>& imu,
                               const SensorCalibration& calibration,
                               const VisionCheckOptions& options);

}  // namespace adasfm
