// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/estimate_priors.h"
#include "sensors/smoother/build_odometry_links.h"

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

// The first of num_links links from one image of a rotation to the other; none
// where these are not so far apart, or the rotation has too few inliers.
std::optional<size_t> FindLinkOfRotation(const TimedRotation& rotation,
                                         timestamp_t timeshift_ns,
                                         const OdometryTimeline& timeline,
                                         size_t num_links = 1);

// The body's rotation (first_from_second) from the camera's.
Eigen::Quaterniond BodyRotation(const TimedRotation& rotation,
                                const Eigen::Quaterniond& cam_from_imu);

}  // namespace adasfm
