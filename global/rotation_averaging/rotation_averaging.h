// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>

#include "core/types.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct RotationAveragingOptions {
  // Start from the rank-restricted SDP (Chen et al. 2021), as the paper does,
  // instead of the maximum spanning tree alone. Off: on 28 sets, up to 60 % of
  // wrong rotations without sensors among them, it changed no model.
  bool use_sdp_start = false;
  // Rank at which the block coordinate descent starts; the staircase adds one
  // until the certificate holds or max_rank is reached.
  int min_rank = 3;
  int max_rank = 6;
  int max_num_sdp_sweeps = 100;
  // Sweeps stop when the cost's relative change falls below this.
  double sdp_tolerance = 1e-6;

  // Chatterjee and Govindu 2013: first L1 steps, then IRLS.
  int max_num_l1_iterations = 10;
  int max_num_irls_iterations = 100;
  // Iterations stop when the mean change falls below this.
  double convergence_rad = 1e-7;
  // Where the robust loss takes over, degrees; never below three sigmas.
  double loss_scale_deg = 2.0;
  // Sigmas of edges below this are taken as this, so that no edge dominates.
  double min_rotation_sigma_rad = 2e-4;

  bool IsValid(std::string* error) const;
};

struct GlobalRotations {
  // False when the graph has no images or its edges with rotation do not
  // connect it; cams_from_world then holds nothing.
  bool success = false;
  bool converged = false;
  std::map<image_t, Eigen::Quaterniond> cams_from_world;
  int num_iterations = 0;
  // The start: rank reached, and a lower bound of the optimum's share in the
  // cost of the rotations that the averaging began with, in plain squares (1:
  // certified optimal, 0: nothing known).
  int sdp_rank = 0;
  double sdp_optimality = 0.0;
};

// Rotations R_i with R_j R_i^T ~ R_ij over the kept edges with a rotation, by
// their sigmas, robustly (paper, eq. 1). The first image has the identity. The
// graph must be connected through edges with a rotation.
GlobalRotations EstimateGlobalRotations(const RotationAveragingOptions& options,
                                        const ViewGraph& graph);

}  // namespace adasfm
