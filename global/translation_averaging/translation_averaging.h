// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <vector>

#include "core/types.h"
#include "global/odometry/edge_lengths.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// 1 sigma of the distance of two images of a camera at rest, in median lengths
// of edges: what vision overlooks of a step.
inline constexpr double kRestSigmaRatio = 0.02;

struct TranslationAveragingOptions {
  // Second stage: directions across and lengths along the edge weigh by their
  // own sigmas, with a Cauchy loss.
  bool refine = true;
};

struct GlobalPositions {
  bool success = false;
  bool converged = false;
  // Metric when any edge has length_m.
  bool metric = false;
  std::map<image_t, Eigen::Vector3d> centers;
  int num_iterations = 0;
  // Mean movement of the ends of an edge against each other in the last
  // iteration, over the median edge length.
  double last_change = 0.0;
};

// Camera centres from directions (paper, eq. 3): min sum of
// | s_ij (C_i - C_j) - R_j^T t_ij | over kept edges with a translation,
// s_ij >= 0, robust L1. Edges with length_m keep s_ij = 1 / length. For fixed s
// and weights this is one scalar graph Laplacian with three right-hand sides.
// Stages:
//   1 without initial_centers (all images or none): soft_lengths (one per edge,
//     may be empty) are held; convex
//   2 with metres or without refine: all lengths but length_m free; bilinear
//   3 refine: across and along the edges by their own sigmas
// Gauge: the first image is at the origin; without metres the median edge
// length is 1. The graph must be connected through edges with a translation.
GlobalPositions EstimateGlobalPositions(
    const TranslationAveragingOptions& options, const ViewGraph& graph,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::vector<std::optional<EdgeLength>>& soft_lengths,
    const std::map<image_t, Eigen::Vector3d>& initial_centers);

}  // namespace adasfm
