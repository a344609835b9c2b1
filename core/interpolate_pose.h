// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/rigid3d.h"
#include "core/sensor_log.h"
#include "core/types.h"

namespace adasfm {

// world_from_body of a trajectory, sorted by time, at time_ns: the pose of that
// time, or between two poses at most max_gap_s apart, rotations by slerp.
std::optional<Rigid3d> InterpolatePose(
    const std::vector<OdometryPose>& trajectory, timestamp_t time_ns,
    double max_gap_s);

}  // namespace adasfm
