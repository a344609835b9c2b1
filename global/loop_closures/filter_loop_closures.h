// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// What is known of the motion from image to image.
struct TrajectoryOdometry {
  // With the odometry edges that vision completed.
  OdometryChain chain;
  // One per edge of the graph, in the unit of the chain, as far as known.
  std::vector<std::optional<EdgeLength>> lengths;
  // A typical length: 1 m, or the median length of an odometry edge.
  double unit = 1.0;
  // Of the sensors.
  std::vector<RelativePosePrior> priors;
};

// Two segments that loop closures could join, with nothing to confirm them: the
// two places may only look alike.
struct UnconfirmedClosure {
  // The pair with most inliers, and how many there are.
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  int num_pairs = 0;
  // Of the smaller segment.
  int num_images = 0;
};

struct LoopClosureReport {
  int num_tested = 0;
  int num_contradicting = 0;  // pairs that the odometry excludes
  int num_clusters = 0;       // of loop closures within a segment
  int num_false_clusters = 0;
  int num_pairs_of_false_clusters = 0;
  int num_segments = 0;
  // Two segments each.
  int num_confirmed_closures = 0;
  std::vector<UnconfirmedClosure> unconfirmed_closures;
  // Whether these were removed (split_unconfirmed_closures).
  bool segments_were_split = false;
  int num_pairs_of_unconfirmed_closures = 0;
};

// What: removes false loop closures (perceptual aliasing).
// Inputs: the odometry; the graph, with a relative pose and its sigmas for each
// edge (rad; directions without a length are unit vectors).
// Method:
// 1. a pair whose chi-square against the odometry true pairs seldom exceed
//    contradicts it (kOdometryPose; kOdometry for loop closures);
// 2. within a trajectory segment each cluster of loop closures, pairs between
//    the same two windows of images, votes: when most contradict, all go
//    (kFalseLoop); when most do not, those that do have a wrong pose of a true
//    place (kOdometryPose);
// 3. between two segments no odometry contradicts. Pairs that are inconsistent
//    with the best one of their cluster go, those outside of a heavy pairwise
//    consistent set of clusters, and all of them unless it holds two places
//    beyond a turn from each other at both ends (kUnconfirmedClosure): a single
//    place always fits, and a straight street that looks alike all along fits
//    everywhere. Off with split_unconfirmed_closures.
// What holds each rule, and what was tried beside: docs/reference/global.md,
// False loop closures. On failure: throws std::invalid_argument for invalid
// options, or where there is not one length per edge.
LoopClosureReport FilterLoopClosures(const LoopClosureOptions& options,
                                     const TrajectoryOdometry& odometry,
                                     ViewGraph* graph);

}  // namespace adasfm
