// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct EdgeLength {
  // Distance of the centres: metres when metric, else in the unit of the
  // scene's depth.
  double length = 0.0;
  // 1 sigma of log(length).
  double log_sigma = 0.0;
  // No metres reach the edge, though the graph has some. The scene is assumed
  // to be as deep there as elsewhere, which is right within a factor of two or
  // so.
  bool is_by_depth = false;
};

struct EdgeLengths {
  // One per edge of the graph; empty where nothing was learned.
  std::vector<std::optional<EdgeLength>> lengths;
  // One per edge: a pair without a baseline that sees points of known depth.
  // Where a bonnet is all that two images share, they do not.
  std::vector<bool> is_at_known_depth;
  bool metric = false;
};

// Estimates baseline lengths of two-view edges. A keypoint matched in several
// edges has one depth; each edge measures it in units of its own baseline, so
// ratios of depths are ratios of baselines. Metric lengths of the priors start
// the estimation; without any the depth of the scene sets the unit. This
// determines collinear centres, which directions alone leave free.
// known_lengths_m: of sensor edges. start: lengths found before, of the same
// graph's edges, or none.
EdgeLengths EstimateEdgeLengths(
    int num_threads, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences,
    const EdgeLengths& start = EdgeLengths());

}  // namespace adasfm
