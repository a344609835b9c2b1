// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/rigid3d.h"
#include "core/sensor_log.h"
#include "core/types.h"

namespace adasfm {

// Interpolates world_from_body of a trajectory, sorted by time, rotations by
// slerp. Nothing outside the trajectory or in a gap above max_gap_s.
std::optional<Rigid3d> InterpolatePose(
    const std::vector<OdometryPose>& trajectory, timestamp_t time_ns,
    double max_gap_s);

}  // namespace adasfm
