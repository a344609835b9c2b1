// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/rigid3d.h"
#include "global/loop_closures/drive_parts.h"
#include "global/odometry/edge_lengths.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Neighbouring pairs between the same two parts of a drive, and what the one of
// them with most inliers says.
struct JoinCell {
  // Indices of the edge and of its images, the first of which lies in the first
  // part.
  struct Crossing {
    int edge = 0;
    int i = 0;
    int j = 0;
  };
  std::vector<Crossing> crossings;
  Crossing best;
  // Whether the pair's length is known, and both images have poses in their
  // parts.
  bool has_motion = false;
  Rigid3d j_from_i;  // of the best
};

// By the indices of both parts, the smaller first.
using JoinCells = std::map<std::pair<int, int>, std::vector<JoinCell>>;

// The kept pairs between two parts; those with both ends in the same span of
// cell_size images share a cell. lengths: one per edge, as far as known.
JoinCells CollectJoinCells(
    const ViewGraph& graph, const DriveParts& parts,
    const std::vector<std::optional<EdgeLength>>& lengths, int cell_size);

}  // namespace adasfm
