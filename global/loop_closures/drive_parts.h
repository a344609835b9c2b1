// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Smaller parts belong to that with which they share most pairs.
inline constexpr int kMinNumPartImages = 3;

// The parts of a drive: images between which priors with a position, or pairs
// of images that follow each other, lead from one to the next. All vectors are
// in the order of ViewGraph::images.
struct DriveParts {
  // The index of one image of the part, the same for all of them.
  std::vector<int> part_of;
  // By the same index; 0 for all others.
  std::vector<int> num_images;
  // By the same index: a prior with a position gives metres.
  std::vector<bool> is_metric;
  // ViewGraph::CaptureRank.
  std::vector<int64_t> rank_of;
  // Counts the turns of the odometry: a new street begins where the camera
  // looks min_turn_deg away from where it looked at the beginning of the last.
  std::vector<int> street_of;

  // Whether what is seen at one image is evidence beside what is seen at the
  // other: a turn lies between them.
  bool AreApart(const LoopClosureOptions& options, int i, int j) const;
};

DriveParts FindDriveParts(const LoopClosureOptions& options,
                          const std::vector<RelativePosePrior>& priors,
                          const OdometryChain& chain, const ViewGraph& graph);

}  // namespace adasfm
