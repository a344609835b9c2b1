// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "global/correspondences.h"
#include "global/view_graph.h"

namespace adasfm {

struct RelativePoseRefinementOptions {
  bool enabled = true;
  int max_num_iterations = 8;
  // Matches beyond this many add nothing; an even subset is taken.
  int max_num_matches = 150;
  // 1 sigma of a keypoint: the least noise assumed, px.
  double keypoint_sigma_px = 0.5;
  // Where the Cauchy loss takes over, px of epipolar distance.
  double loss_scale_px = 1.5;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

// Turns the poses that verification left (fit to few matches) into least-
// squares ones: every kept visual edge's rotation and direction minimise the
// first-order (Sampson) epipolar distances in px of its matches, robustly, and
// their sigmas follow from the normal matrix. An edge without a useful pose
// (fewer than 8 matches, or the solve fails) keeps what it had.
void RefineRelativePoses(const RelativePoseRefinementOptions& options,
                         const GlobalCorrespondences& correspondences,
                         ViewGraph* graph);

}  // namespace adasfm
