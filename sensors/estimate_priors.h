// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/io/calibration.h"
#include "sensors/sensor_summary.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// One image on the camera's clock.
struct ImageStamp {
  image_t image_id = kInvalidImageId;
  std::string name;
  timestamp_t timestamp_ns = 0;
};

// Logs in order of time, on the IMU's clock; empty for a sensor that the
// machine does not have.
struct SensorLogs {
  std::vector<ImuSample> imu;
  std::vector<WheelSample> wheel;
  std::vector<OdometryPose> odometry;
};

// A verified two-view rotation of the database.
struct VisualRotation {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  Eigen::Quaterniond cam2_from_cam1 = Eigen::Quaterniond::Identity();
  int num_inliers = 0;
  // Median over the inliers of the angle between the two rays of a match, each
  // in its own camera's frame, rad; 0 when unknown.
  double median_motion_rad = 0.0;
};

struct PriorEstimationOptions {
  OdometryLinkOptions links;
  // Whether two-view rotations help to find the gyroscope's bias, and where
  // wheels without an IMU slip.
  bool use_visual_rotations = true;
  // Whether a contradiction between sensors is an error: vision against the
  // gyroscope (sensors/calibration_check/check_against_vision.h), wheels
  // against the IMU (check_wheels.h there). Else it is a warning.
  bool check_against_vision = true;
  // Whether the time shift between vision and gyroscope is added to the
  // calibration's: 0 no, 1 yes, -1 only if vision determines it clearly and it
  // may be a clock offset (VisionCheck::is_clock_shift). 0 also leaves the
  // wheels' clock uncorrected.
  int estimate_time_shift = -1;
  // Whether a low-pass filter in the gyroscope's log that vision clearly shows
  // (sensors/calibration_check/gyroscope_filter.h) is undone.
  bool undo_gyroscope_filter = true;
  OdometryFusionOptions fusion;

  bool IsValid(std::string* error) const;
};

struct PriorEstimate {
  // One for each pair of consecutive images with data, in order of time.
  std::vector<RelativePosePrior> priors;
  // One for each pair of consecutive images between which the IMU has no gap.
  std::vector<InertialMotion> inertial_motions;
  // Unit vectors that point down.
  std::map<image_t, Eigen::Vector3d> gravity_in_cam;
  // Includes the calibration parameters that all priors share: gyroscope_bias
  // (rad/s, body frame) with gyroscope_bias_covariance, wheel_scale with
  // wheel_scale_sigma.
  SensorSummary summary;
};

// Computes priors from logs: (1) orders the images and finds those inside the
// logs, (2) compares vision with the gyroscope and the wheels with the IMU, (3)
// preintegrates between images, (4) smooths all logs at once, (5) expresses
// motion and covariance in the camera frames. Flags state what the sensors
// observe (core/relative_pose_prior.h). Bad data gives a status of one line;
// invalid options throw std::invalid_argument.
StatusOr<PriorEstimate> EstimatePriors(
    const std::vector<ImageStamp>& images, const SensorLogs& logs,
    const SensorCalibration& calibration,
    const std::vector<VisualRotation>& visual_rotations,
    const PriorEstimationOptions& options);

}  // namespace adasfm
