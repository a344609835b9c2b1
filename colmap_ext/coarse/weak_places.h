// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/types.h"
#include "global/estimate_coarse_poses.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Where two coarse models might be one: verified pairs of images lead from one
// to the other, and all of them were refused, or nothing confirmed them.
struct WeakPlace {
  // Indices of the models, the smaller first.
  int model1 = 0;
  int model2 = 0;
  // The pair with most inliers, of how many, and why it was refused.
  ImagePair pair;
  int num_inliers = 0;
  int num_pairs = 0;
  EdgeRemoval removal = EdgeRemoval::kKept;
};

// One per two models that pairs lead between, in order of the models.
std::vector<WeakPlace> FindWeakPlaces(const CoarsePoses& poses);

}  // namespace adasfm
