// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/types.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct UnverifiedJoinOptions {
  // Images at most this far apart in the order of capture are taken to follow
  // each other; edges of that kind make the pieces of a drive.
  int max_sequence_gap = 10;
  // Smaller pieces are let be.
  int min_num_images = 10;

  bool IsValid(std::string* error) const;
};

// Two parts of a component that hang together by pairs at one place only.
struct UnverifiedJoin {
  // The pair of that place with most inliers, and how many pairs there are.
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  int num_pairs = 0;
  // Of the smaller part.
  int num_images = 0;
};

// The joins that nothing else in the graph confirms: if the two places only
// look alike, all pairs still agree with each other, and the model is folded
// without any sign of it. Pieces follow from kept edges along the sequence (of
// sensors too: with odometry there is one piece); pairs between two pieces,
// both ends of which lie beside each other's, are one place; places that are
// bridges between the pieces are returned, in order of their pairs.
std::vector<UnverifiedJoin> FindUnverifiedJoins(
    const UnverifiedJoinOptions& options, const ViewGraph& graph);

}  // namespace adasfm
