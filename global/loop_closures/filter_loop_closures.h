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

// The loop closures between two trajectory segments.
struct SegmentClosure {
  // The pair with the most inliers, and the number of pairs.
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
  // Each one joins two segments.
  int num_confirmed_closures = 0;
  // Those of them that vision alone confirms, by two places beyond a turn:
  // without metres on both sides, and not at the same time. Streets that look
  // alike around a corner confirm themselves in the same way.
  std::vector<SegmentClosure> closures_by_vision;
  // Nothing confirms these: possibly perceptual aliasing.
  std::vector<SegmentClosure> unconfirmed_closures;
  // Whether unconfirmed closures were removed (split_unconfirmed_closures).
  bool segments_were_split = false;
  int num_pairs_of_unconfirmed_closures = 0;
};

// Removes false loop closures (perceptual aliasing). graph: with a relative
// pose and its sigmas for each edge (rad; directions without a length are unit
// vectors).
// 1. A pair whose chi-square against the odometry exceeds what true pairs
//    seldom exceed contradicts the odometry (kOdometryPose; kOdometry for loop
//    closures).
// 2. Within a trajectory segment each cluster of loop closures (pairs between
//    the same two windows of images) votes. When at least half of its pairs
//    contradict the odometry, the others are removed too (kFalseLoop).
//    Otherwise the contradicting pairs have a wrong pose of a true place
//    (kOdometryPose).
// 3. Between two segments there is no odometry to contradict pairs. Pairs are
//    removed that are inconsistent with the best pair of their cluster, or
//    whose cluster is outside of a pairwise consistent set of large weight. All
//    are removed unless this set contains two places that are separated by a
//    turn at both ends (kUnconfirmedClosure): a single place always fits, and a
//    straight street that looks alike all along fits everywhere. The turn is
//    not needed where two drives are at both places at the same time. Off
//    without split_unconfirmed_closures.
// Evidence for each rule and alternatives: docs/reference/global.md, False loop
// closures. Throws std::invalid_argument for invalid options, or where there is
// not one length per edge.
LoopClosureReport FilterLoopClosures(const LoopClosureOptions& options,
                                     const TrajectoryOdometry& odometry,
                                     ViewGraph* graph);

}  // namespace adasfm
