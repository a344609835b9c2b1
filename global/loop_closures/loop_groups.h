// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "global/loop_closures/drive_parts.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/loop_closures/pair_motion.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Pairs that join the same two places: one loop closure. Images are indices of
// ViewGraph::images.
struct LoopGroup {
  std::vector<int> edges;
  // What one pair says, that with most inliers of those that the odometry does
  // not exclude, with a length if there are any, from image i to image j; i
  // lies in the part of the smaller index or, within one part, earlier.
  int i = 0;
  int j = 0;
  PairMotion j_from_i;
};

// Whether two groups between the same parts agree: the cycle through both pairs
// and the odometry at both of their ends, by its chi-square. none: the odometry
// does not lead from one to the other. unit_log_sigma: of the unit of the
// second part in that of the first.
std::optional<bool> AreConsistent(const LoopClosureOptions& options,
                                  const OdometryChain& chain,
                                  const ViewGraph& graph, const LoopGroup& a,
                                  const LoopGroup& b, double unit_log_sigma);

// Groups the edges: the pair with most inliers and those that are consistent
// with it, with both ends within max_sequence_gap of its ends and in the same
// streets; and so on with those that are left. pairs, is_excluded (by the
// odometry): by edge. Excluded ones come last, and join any group around them.
std::vector<LoopGroup> GroupLoops(
    const LoopClosureOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, const DriveParts& parts,
    const std::vector<PairMotion>& pairs, const std::vector<bool>& is_excluded,
    const std::vector<int>& edges, double unit_log_sigma);

}  // namespace adasfm
