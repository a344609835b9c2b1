// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "core/relative_pose_prior.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The camera's motion over links first, ..., last - 1, with its covariance and
// the flags of what the links' sensors observe; images and dt are not set. The
// errors of successive links are correlated (one speed, one bias), so the sum
// of n covariances is multiplied by n; links of one standstill count as one.
RelativePosePrior ComposePrior(const OdometryFusionProblem& problem,
                               const OdometryFusionResult& fused, size_t first,
                               size_t last, const Rigid3d& cam_from_imu);

// Where the machine is parked in one of links first, ..., last - 1: how long it
// moves in the others, s. Over that time alone errors of rates add up.
std::optional<double> SecondsBesideParking(const OdometryFusionProblem& problem,
                                           size_t first, size_t last);

}  // namespace adasfm
