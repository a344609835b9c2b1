// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"
#include "global/edge_lengths.h"
#include "global/view_graph.h"

namespace adasfm {

struct TranslationAveragingOptions {
  int max_num_iterations = 200;
  // Iterations stop when no centre moves by more than this share of the median
  // edge length.
  double convergence_ratio = 1e-4;
  // Sigmas of directions and of relative lengths below this are taken as this.
  double min_sigma = 2e-3;
  // L1 weights are bounded: residuals below this (relative to the edge's
  // length) weigh alike.
  double min_residual = 1e-3;
  // Second stage: directions across and lengths along the edge weigh by their
  // own sigmas (Cauchy loss, in sigmas).
  bool refine = true;
  double refine_loss_scale = 3.0;
  int max_num_refine_iterations = 20;

  bool IsValid(std::string* error) const;
};

struct GlobalPositions {
  bool success = false;
  bool converged = false;
  // Metric when any edge has length_m.
  bool metric = false;
  std::map<image_t, Eigen::Vector3d> centers;
  int num_iterations = 0;
  // Largest movement of the last iteration over the median edge length.
  double last_change = 0.0;
};

// Camera centres from directions (paper, eq. 3): min sum of
// | s_ij (C_i - C_j) - R_j^T t_ij | over kept edges with a translation,
// s_ij >= 0, robust L1. Edges with length_m keep s_ij = 1 / length. For fixed s
// and weights this is one scalar graph Laplacian with three right-hand sides.
// soft_lengths (one per edge, may be empty) start the lengths of the others.
// initial_centers (may be empty) is the start; without it the lengths are held
// first, which is a convex problem. Gauge: without metres the median edge
// length is 1; the first image is at the origin. The graph must be connected
// through edges with a translation.
GlobalPositions EstimateGlobalPositions(
    const TranslationAveragingOptions& options, const ViewGraph& graph,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::vector<std::optional<EdgeLength>>& soft_lengths,
    const std::map<image_t, Eigen::Vector3d>& initial_centers);

// Removes edges whose direction is off the positions by more than
// max_discrepancy_deg plus num_sigmas of its own. Returns how many.
int FilterEdgesByPosition(
    double max_discrepancy_deg, double num_sigmas,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Vector3d>& centers, ViewGraph* graph);

}  // namespace adasfm
