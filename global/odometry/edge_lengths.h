// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct EdgeLengthOptions {
  // Matches with rays closer than this say nothing about depth.
  double min_parallax_deg = 1.0;
  // Matches used per edge, those with the largest parallax.
  int max_num_matches = 150;
  // Keypoints with known depth that an edge must share.
  int min_num_shared = 5;
  // Edges that share at least this many come first; without metres, images out
  // of their reach start a part with a unit of its own.
  int num_shared_reliable = 20;
  // Lengths less certain than this (1 sigma of their logarithm) are not
  // learned.
  double max_log_sigma = 0.2;
  // Passes over all edges after the first.
  int num_sweeps = 3;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct EdgeLength {
  // Distance of the centres: metres when metric, else in the unit of the
  // scene's depth.
  double length = 0.0;
  // 1 sigma of log(length).
  double log_sigma = 0.0;
  // No metres reach the edge, though there are some: the scene is taken to be
  // as deep there as elsewhere, which is right within a factor of two or so.
  bool is_by_depth = false;
};

struct EdgeLengths {
  // One per edge of the graph; empty where nothing was learned.
  std::vector<std::optional<EdgeLength>> lengths;
  bool metric = false;
};

// How long the visual edges are, through the points that they share: a keypoint
// has one depth in its image, and each edge sees it as a multiple of its own
// length. Metric lengths of the priors start it; without any
// the depth of the scene sets the unit. So collinear centres, which directions
// alone leave free, become solvable. known_lengths_m: of sensor edges. start:
// lengths found before, of the same graph's edges, or none.
EdgeLengths EstimateEdgeLengths(
    const EdgeLengthOptions& options, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences,
    const EdgeLengths& start = EdgeLengths());

}  // namespace adasfm
