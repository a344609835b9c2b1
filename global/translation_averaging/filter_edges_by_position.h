// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"
#include "global/odometry/edge_lengths.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Removes visual edges that do not fit the positions. The length matters too:
// aliased places in one direction differ in length only. lengths: one per edge,
// in the positions' unit; may be empty. Returns how many were removed.
int FilterEdgesByPosition(
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Vector3d>& centers,
    const std::vector<std::optional<EdgeLength>>& lengths, ViewGraph* graph);

}  // namespace adasfm
