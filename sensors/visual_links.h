// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/estimate_priors.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The rotations between images with a time (camera clock), forwards in time.
std::vector<TimedRotation> ComputeTimedRotations(
    const std::vector<VisualRotation>& rotations,
    const std::map<image_t, timestamp_t>& image_times_ns);

// From and to when the images in a row saw the machine move (camera clock), one
// after the other: half of the matches moved by more than keypoints err.
std::vector<std::pair<timestamp_t, timestamp_t>> FindSeenMotion(
    const std::vector<VisualRotation>& rotations,
    const std::map<image_t, timestamp_t>& image_times_ns);

struct VisualLinks {
  int num_links = 0;
  // 1 sigma of an axis when not turning, rad.
  double sigma_rad = 0.0;
};

// The first of num_links links from one image of a rotation to the other; none
// where these are not so far apart, or the rotation has too few inliers.
std::optional<size_t> FindLinkOfRotation(const TimedRotation& rotation,
                                         timestamp_t timeshift_ns,
                                         const OdometryTimeline& timeline,
                                         size_t num_links = 1);

// The body's rotation (first_from_second) from the camera's.
Eigen::Quaterniond BodyRotation(const TimedRotation& rotation,
                                const Eigen::Quaterniond& cam_from_imu);

// Gives the links of `problem` that join two images in a row what vision saw of
// their rotation, as a further observation: over many links it holds the
// gyroscope's bias, which nothing else on a moving machine observes about the
// vertical. How exact vision is follows from its distance to the gyroscope
// (less a constant, by medians) and is taken for half as much again, because
// errors of neighbouring pairs are alike (shutter) and because vision is used
// again later; turning adds a share of the turn (a slightly turned T_cam_imu).
// Vision with too few pairs, or with a sigma beyond 0.2 deg, changes nothing.
VisualLinks AddVisualRotations(const std::vector<TimedRotation>& rotations,
                               timestamp_t timeshift_ns,
                               const Eigen::Quaterniond& cam_from_imu,
                               const OdometryTimeline& timeline,
                               OdometryFusionProblem* problem);

}  // namespace adasfm
