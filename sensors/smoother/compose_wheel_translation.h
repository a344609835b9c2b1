// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "core/inertial_motion.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// What the wheels say of the camera's translation over links first, ...,
// last - 1, by the fused rotations, wheel scale, mounting and delay, but
// without the accelerometer: the equation of wheel_factors.cc, solved for the
// step. The errors of the links are independent, those of what is shared are
// not in the covariance. At rest it is zero. None where a link has no wheels or
// they slip.
std::optional<MeasuredTranslation> ComposeWheelTranslation(
    const OdometryFusionProblem& problem, const OdometryFusionOptions& options,
    const OdometryFusionResult& fused, size_t first, size_t last,
    const Rigid3d& cam_from_imu);

}  // namespace adasfm
