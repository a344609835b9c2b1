// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/types.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Adds the uncertainty of missing samples to the covariances of the links
// between times_ns. The links were integrated from the logs, in which holes
// (steps of more than 1.5 periods) were bridged by a straight line. The error
// variance of a bridge's mean is measured on stretches of the same length
// elsewhere in the log. The rotation error propagates into velocity and
// position over the rest of the link. A log of fewer than 100 samples adds
// nothing.
void AddHoleUncertainty(const MotionLogs& logs,
                        const std::vector<timestamp_t>& times_ns,
                        const Eigen::Quaterniond& imu_from_wheel,
                        std::vector<OdometryLink>* links);

}  // namespace adasfm
