// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/types.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// What: adds to the links' covariances what samples that a log lacks could have
// held.
// Inputs: the links between times_ns, integrated from the logs, in which holes
// (steps of more than 1.5 periods) were bridged by a straight line.
// Method: the mean over a hole differs from that of the straight line by an
// error whose variance the log itself tells, from stretches of the same length
// elsewhere in it. The error of the rotation goes on into velocity and position
// over the rest of the link.
// On failure: a log too short to tell (fewer than 100 samples) adds nothing.
void AddHoleUncertainty(const MotionLogs& logs,
                        const std::vector<timestamp_t>& times_ns,
                        const Eigen::Quaterniond& imu_from_wheel,
                        std::vector<OdometryLink>* links);

}  // namespace adasfm
