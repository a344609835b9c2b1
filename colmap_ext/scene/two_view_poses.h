// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct InitialViewGraph {
  // All images of the scene; the pairs that have a relative pose.
  ViewGraph graph;
  int num_stored_poses = 0;
  int num_decomposed = 0;
  int num_reestimated = 0;
  // Watermarks, degenerate pairs, and those whose matches support no pose.
  int num_without_pose = 0;
};

// Step 2.1: builds the view graph of the verified pairs. A pair's pose is the
// stored one or the decomposed essential matrix, the first that enough matches
// support; else (for example planar, uncalibrated and multiple configurations)
// the five-point solution of its inlier matches. Pairs are independent, each
// with its own random seed, so that threads do not change the result.
InitialViewGraph BuildInitialViewGraph(
    const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    int num_threads = -1);

// The pose (unit translation) from an essential matrix for which most points
// lie in front of both cameras.
Rigid3d DecomposeEssential(const Eigen::Matrix3d& essential_matrix,
                           const std::vector<Bearing>& bearings1,
                           const std::vector<Bearing>& bearings2,
                           const std::vector<FeatureMatch>& matches);

}  // namespace adasfm
