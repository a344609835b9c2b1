// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/estimate_priors.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/use_vision.h"

namespace adasfm {

struct FusionInput {
  OdometryTimeline timeline;
  OdometryFusionProblem problem;
  // Links where wheels without the IMU slip (sensors/seen_wheel_yaw.h).
  int num_seen_slips = 0;
};

// Builds the smoother's problem and its initial states: preintegrates the logs
// between the images, with states between images far apart. times_ns: of the
// images, ascending, on the IMU's clock.
FusionInput BuildFusionProblem(const PriorEstimationOptions& options,
                               const SensorCalibration& calibration,
                               const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs, const VisionUse& vision);

}  // namespace adasfm
