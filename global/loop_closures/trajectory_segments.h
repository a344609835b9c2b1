// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Smaller segments are joined to the segment with which they share the most
// pairs.
inline constexpr int kMinNumSegmentImages = 3;

// The segments of a trajectory: images that are connected by priors with a
// position or by pairs of images that follow each other. All vectors are in the
// order of ViewGraph::images.
struct TrajectorySegments {
  // The index of one image of the segment, the same for all of them.
  std::vector<int> segment_of;
  // By the same index; 0 for all others.
  std::vector<int> num_images;
  // By the same index: a prior with a position gives metres.
  std::vector<bool> is_metric;
  // ViewGraph::CaptureRank.
  std::vector<int64_t> rank_of;
  // Number of the image's heading in the odometry: a new heading begins where
  // the rotation exceeds 30 deg since the last one began, and with each piece.
  std::vector<int> heading_of;
};

TrajectorySegments FindTrajectorySegments(
    const LoopClosureOptions& options,
    const std::vector<RelativePosePrior>& priors, const OdometryChain& chain,
    const ViewGraph& graph);

}  // namespace adasfm
