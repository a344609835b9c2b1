// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Leaves out the wheels where only cameras can tell that they slip: of wheels
// that tell a turn, on links without the IMU. Where one wheel slips its log
// turns, by tens of degrees within a link, and no pair of images across it
// would agree with the odometry. With the yaw error e = (wheels - vision) of a
// link, its sigma is the larger one of the wheels' own and of what the median
// of |e| over all links tells, and what the options let track width and
// curvature err by; beyond slip_threshold_sigma nothing is known of the link's
// motion, its length included. Vision has no other part in these priors, since
// it is used again later. More than a fifth of the links are no slips, and left
// as they are.
//
// Returns the number of links that slip.
int LeaveOutSeenSlips(const std::vector<TimedRotation>& rotations,
                      timestamp_t timeshift_ns,
                      const Eigen::Quaterniond& cam_from_imu,
                      const OdometryTimeline& timeline,
                      const OdometryFusionOptions& options,
                      OdometryFusionProblem* problem);

}  // namespace adasfm
