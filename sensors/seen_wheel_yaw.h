// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Calibrates wheels without an IMU against the cameras and finds their slips,
// on links that join two consecutive images. `rotations` are two-view rotations
// on the camera's clock; the links are those of `problem`.
//
// Wheels that differ by 0.4 % turn by 0.004 rad/m, which passes for a turn of
// 50 deg over 200 m. The error m of the track width and the curvature c in
//
//   true yaw - wheels' yaw = m (wheels' yaw) + c distance
//
// are estimated from all links by iteratively reweighted least squares (Cauchy,
// scale from the median), with the options' sigmas as priors. Their covariance
// is the sandwich estimate over blocks of two seconds, plus the attenuation of
// m by the wheels' noise. The estimate replaces the options' prior in the
// problem (wheel_yaw_prior).
//
// A link whose residual exceeds kSlipThresholdSigma slips, unless wheels and
// cameras agree over this link and a neighbour together (then the image between
// the two links is wrong). The motion of a slipping link is unknown, including
// its length. If more than a fifth of the links seem to slip, none is treated
// as a slip. The yaw variance of links that no camera sees grows by the squared
// residuals of slips, as their mean over all seen links. Links without wheels,
// including slips, get the rotation of the cameras where the rotations among
// three images agree (rotation_triples.h). Vision has no other part in these
// priors, since it is used again later. Fewer than 20 links change nothing.
//
// Returns the number of slipping links.
int UseSeenWheelYaw(const std::vector<TimedRotation>& rotations,
                    timestamp_t timeshift_ns,
                    const Eigen::Quaterniond& cam_from_imu,
                    const OdometryTimeline& timeline,
                    const OdometryFusionOptions& options,
                    OdometryFusionProblem* problem);

}  // namespace adasfm
