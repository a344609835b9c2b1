// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "core/inertial_motion.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The integrals of the IMU over links first, ..., last - 1, minus the fused
// gyroscope bias, in the axes of the camera at the first state. Images and
// by_wheels are not set. None when a link has no IMU.
std::optional<InertialMotion> ComposeInertialMotion(
    const OdometryFusionProblem& problem, const OdometryFusionResult& fused,
    size_t first, size_t last, const Rigid3d& cam_from_imu);

}  // namespace adasfm
