// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// What: what cameras tell of wheels whose yaw no IMU checks, on links that join
// two images in a row.
// Inputs: two-view rotations on the camera's clock; the links of `problem`.
// Method. Wheels that differ by 0.4 % turn by 0.004 rad a metre, which passes
// for a turn of 50 deg over 200 m: with true yaw - wheels' yaw
// = m (wheels' yaw) + c distance the track's error m and the curvature c are
// found from all links, by iteratively reweighted least squares (Cauchy, scale
// from the median) with the options' sigmas as priors. Their covariance is the
// sandwich estimate over blocks of two seconds, and what the wheels' noise
// takes from m. It takes the place of the options' in the problem
// (wheel_yaw_prior). A link beyond slip_threshold_sigma slips, unless wheels
// and cameras agree over it and a neighbour together (then the image between
// errs): nothing is known of its motion, its length included; more than a fifth
// of the links are no slips, and left as they are. Links that no camera sees
// get the mean square, over all seen links, of what slips turn too much. Links
// without wheels, the slips among them, turn as cameras saw, where the
// rotations among three images agree (rotation_triples.h). Vision has no other
// part in these priors, since it is used again later. On failure: fewer than 20
// links change nothing.
//
// Returns the number of links that slip.
int UseSeenWheelYaw(const std::vector<TimedRotation>& rotations,
                    timestamp_t timeshift_ns,
                    const Eigen::Quaterniond& cam_from_imu,
                    const OdometryTimeline& timeline,
                    const OdometryFusionOptions& options,
                    OdometryFusionProblem* problem);

}  // namespace adasfm
