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

struct PositionFilterOptions {
  // Directions may be off by this plus max_num_sigmas of their own.
  double max_direction_discrepancy_deg = 10.0;
  double max_num_sigmas = 5.0;
  // Lengths known from shared points may be off by this factor, both ways.
  double max_length_ratio = 3.0;

  bool IsValid(std::string* error) const;
};

// Removes edges that do not fit the positions: look-alike places in one
// direction differ in length only. lengths: one per edge, may be empty; only
// compared when all share the positions' unit. Returns how many were removed.
int FilterEdgesByPosition(
    const PositionFilterOptions& options,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Vector3d>& centers,
    const std::vector<std::optional<EdgeLength>>& lengths, ViewGraph* graph);

}  // namespace adasfm
