// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// What is known of the motion from image to image.
struct DriveOdometry {
  // With the steps that vision completed.
  OdometryChain chain;
  // One per edge of the graph, in the unit of the chain, as far as known.
  std::vector<std::optional<EdgeLength>> lengths;
  // A typical length: 1 m, or the median length of a step.
  double unit = 1.0;
  // Of the sensors.
  std::vector<RelativePosePrior> priors;
};

// Two parts of a drive that pairs could join, with nothing to confirm it: the
// two places may only look alike.
struct UnverifiedJoin {
  // The pair with most inliers, and how many there are.
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  int num_pairs = 0;
  // Of the smaller part.
  int num_images = 0;
};

struct LoopClosureReport {
  int num_tested = 0;
  int num_contradicting = 0;  // pairs that the odometry excludes
  int num_loops = 0;          // places that are seen again, within a part
  int num_false_loops = 0;
  int num_pairs_of_false_loops = 0;
  int num_parts = 0;
  int num_confirmed_joins = 0;
  // Whether unverified joins were removed (split_unverified_joins).
  bool joins_were_split = false;
  int num_pairs_of_unverified_joins = 0;
  std::vector<UnverifiedJoin> unverified_joins;
};

// Removes false loops (perceptual aliasing):
// 1. pairs that the odometry's chi-square test excludes (kOdometryRotation,
//    kOdometryPosition);
// 2. within a part of the drive, loops most of whose pairs it excludes, and
//    those outside of the heaviest set of consistent ones (kFalseLoop);
// 3. between two parts all pairs outside of the heaviest consistent set with
// two
//    places that are apart from each other in both parts; all of them where
//    there is none (kUnverifiedJoin), unless split_unverified_joins is off.
//    Rings of three parts confirm nothing.
// Step 3 has a reason: a single place always fits, as no odometry contradicts
// it, and a straight street that looks alike all along fits everywhere. It is
// the condition under which the join is observable.
LoopClosureReport FilterLoopClosures(const LoopClosureOptions& options,
                                     const DriveOdometry& odometry,
                                     ViewGraph* graph);

}  // namespace adasfm
