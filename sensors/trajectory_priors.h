// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/sensor_log.h"
#include "core/types.h"
#include "sensors/estimate_priors.h"

namespace adasfm {

// Relative priors from the poses of another estimator (visual-inertial
// odometry, a phone's tracking, lidar odometry). They suit trajectories that
// are smooth from image to image but drift.
struct TrajectoryPriorOptions {
  // Errors of the motion between two images, 1 sigma, for each metre of it:
  // visual-inertial odometry drifts by about 1 %.
  double sigma_m_per_m = 0.01;
  double sigma_deg_per_m = 0.1;
  // An image gets a pose between two trajectory poses at most this far apart:
  // beyond this gap linear interpolation is a guess.
  double max_gap_s = 0.5;

  bool IsValid(std::string* error) const;
};

// cam_from_world of the images inside the trajectory, interpolated. The
// trajectory's clock is the camera's plus the shift.
std::map<image_t, Rigid3d> InterpolateTrajectory(
    const std::vector<OdometryPose>& trajectory, const Rigid3d& cam_from_body,
    timestamp_t timeshift_ns, const std::vector<ImageStamp>& images,
    double max_gap_s);

// Priors of consecutive images (in order of time) that both have poses. Their
// sigmas are at least 1 mm, 0.02 deg and 1 % of the rotation.
std::vector<RelativePosePrior> ComputeTrajectoryPriors(
    const std::vector<ImageStamp>& images,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const TrajectoryPriorOptions& options);

}  // namespace adasfm
