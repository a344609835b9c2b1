// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "global/odometry/edge_lengths.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// The parts of a drive within which priors with a position, or pairs of
// neighbouring images, lead from image to image; and where its images lie.
// All vectors are in the order of ViewGraph::images.
struct DriveParts {
  // The index of one image of the part, the same for all of them.
  std::vector<int> part_of;
  // By the same index; 0 for all others.
  std::vector<int> num_images;
  // ViewGraph::CaptureRank.
  std::vector<int64_t> rank_of;
  // Whether a prior with a position lies in the part.
  std::vector<bool> is_metric;

  // Images with equal values have poses in one frame; -1: none.
  std::vector<int> frame_of;
  std::vector<Rigid3d> cams_from_part;
  // Along the images of the part in the order of capture.
  std::vector<double> way;
  // Counts the turns so far: a new street begins where the camera looks
  // min_turn_deg away from where it looked at the beginning of the last.
  std::vector<int> street_of;
};

// max_gap: pairs of images at most this far apart in the order of capture lead
// from one to the other.
DriveParts FindDriveParts(const ViewGraph& graph,
                          const std::vector<RelativePosePrior>& priors,
                          const std::vector<std::optional<EdgeLength>>& lengths,
                          int max_gap, double min_turn_deg);

}  // namespace adasfm
