// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "core/inertial_motion.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The camera's translation over links first, ..., last - 1 by the wheels, with
// the fused rotations, wheel scale, driving direction and delay, but without
// the accelerometer: the equation of wheel_factors.cc, solved for the step. The
// covariance takes the links' errors as independent and excludes those of
// shared parameters. A link at rest has zero translation. None where a link has
// no wheels or its wheels slip.
std::optional<MeasuredTranslation> ComposeWheelTranslation(
    const OdometryFusionProblem& problem, const OdometryFusionResult& fused,
    size_t first, size_t last, const Rigid3d& cam_from_imu);

}  // namespace adasfm
