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

// Intervals between consecutive images (camera clock, ascending) over which the
// machine is seen to move: half of the matches moved by more than keypoints
// err.
std::vector<std::pair<timestamp_t, timestamp_t>> FindSeenMotion(
    const std::vector<VisualRotation>& rotations,
    const std::map<image_t, timestamp_t>& image_times_ns);

// The first of the num_links links between the two images of a rotation; none
// where the images are not num_links links apart, or the rotation has too few
// inliers.
std::optional<size_t> FindLinkOfRotation(const TimedRotation& rotation,
                                         timestamp_t timeshift_ns,
                                         const OdometryTimeline& timeline,
                                         size_t num_links = 1);

// The body's rotation (first_from_second) from the camera's.
Eigen::Quaterniond BodyRotation(const TimedRotation& rotation,
                                const Eigen::Quaterniond& cam_from_imu);

}  // namespace adasfm
