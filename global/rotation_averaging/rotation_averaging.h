// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>

#include "core/types.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct RotationAveragingOptions {
  // Start from the rank-restricted SDP (Chen et al. 2021), as the paper does,
  // instead of the maximum spanning tree alone. Off: on 28 sets, up to 60 % of
  // wrong rotations without sensors among them, it changed no model.
  bool use_sdp_start = false;
};

struct GlobalRotations {
  // False when the graph has no images, its edges with rotation do not connect
  // it, or a result is not finite; cams_from_world is then empty.
  bool success = false;
  bool converged = false;
  std::map<image_t, Eigen::Quaterniond> cams_from_world;
  int num_iterations = 0;
  // With use_sdp_start: rank reached, and a lower bound of the ratio of the
  // optimal cost to that of the rotations that the averaging began with, in
  // plain squares (1: certified optimal, 0: nothing known).
  int sdp_rank = 0;
  double sdp_optimality = 0.0;
};

// Rotations R_i with R_j R_i^T ~ R_ij over the kept edges with a rotation, by
// their sigmas, robustly (paper, eq. 1). The first image has the identity. The
// graph must be connected through edges with a rotation.
GlobalRotations EstimateGlobalRotations(const RotationAveragingOptions& options,
                                        const ViewGraph& graph);

}  // namespace adasfm
