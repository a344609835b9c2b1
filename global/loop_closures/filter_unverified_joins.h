// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/odometry/edge_lengths.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct JoinFilterOptions {
  bool enabled = true;
  // Images at most this far apart in the order of capture are taken to follow
  // each other; pairs of that kind make the parts of a drive.
  int max_sequence_gap = 10;
  // Smaller parts stay with the part that shares most pairs with them.
  int min_num_images = 3;
  // A look-alike stretch is taken to end where the drive turns by this, or
  // after so many images: what is seen beyond that is evidence of its own.
  double min_turn_deg = 30.0;
  int max_place_images = 100;
  // Pairs that a place needs to be one.
  int min_num_pairs = 3;
  // Two places agree when the ways between them, in either part, do: their
  // turns, and their vectors as a share of the way.
  double max_rotation_error_deg = 15.0;
  double max_position_error_ratio = 0.06;

  bool IsValid(std::string* error) const;
};

// Two parts that pairs could have joined, with nothing to confirm it.
struct SplitJoin {
  // The pair with most inliers, and how many there are.
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  int num_pairs = 0;
  // Of the smaller part.
  int num_images = 0;
};

struct JoinFilterReport {
  int num_parts = 0;
  int num_confirmed = 0;
  int num_removed_pairs = 0;
  std::vector<SplitJoin> split;
};

// Parts of a drive between which neither sensors nor neighbouring images lead
// (all logs end, and then nothing is seen for a while) can only be joined by
// pairs of distant images, and look-alike places make those too. So a join
// needs two places, apart from each other in both parts, that agree on how the
// parts lie to each other; pairs that are not of the largest such agreement are
// removed (kUnverifiedJoin). Rings of three parts and more confirm nothing.
// priors: those with a position lead from image to image. lengths: one per
// edge, as far as known, in one unit within a part; units of parts without such
// priors may differ by a factor of two.
JoinFilterReport FilterUnverifiedJoins(
    const JoinFilterOptions& options,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<std::optional<EdgeLength>>& lengths, ViewGraph* graph);

}  // namespace adasfm
