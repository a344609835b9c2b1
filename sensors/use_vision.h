// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "core/status.h"
#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/estimate_priors.h"
#include "sensors/smoother/motion_logs.h"

namespace adasfm {

// Results of vision for the smoother.
struct VisionUse {
  // None when they contradict the gyroscope.
  std::vector<TimedRotation> rotations;
  // FindSeenMotion, on the camera's clock.
  std::vector<std::pair<timestamp_t, timestamp_t>> seen_moving_ns;
  // IMU time = camera time + shift; begins as the calibration's.
  timestamp_t timeshift_ns = 0;
  // The gyroscope's bias at the start with 1 sigma, rad/s.
  bool has_bias = false;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  double bias_sigma = 0.0;
};

// Compares the two-view rotations with the gyroscope
// (calibration_check/check_against_vision.h). As far as the options allow,
// corrects the time shift, undoes a filter of the log, clears an IMU log that
// shows another motion than the camera's (a stabilised video; the other logs
// stay), or discards the rotations. Returns an error for a contradiction that
// none of these resolves.
Status UseVision(const SensorCalibration& calibration,
                 const PriorEstimationOptions& options, MotionLogs* logs,
                 VisionUse* vision, SensorSummary* summary);

}  // namespace adasfm
