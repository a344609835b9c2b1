// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/types.h"
#include "global/estimate_coarse_poses.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Where two coarse models might be one: verified pairs connect images of both,
// and all of them were rejected, or nothing confirmed them.
struct WeakPlace {
  // Indices of the models, the smaller first.
  int model1 = 0;
  int model2 = 0;
  // The pair with most inliers, the number of pairs, and why it was rejected.
  ImagePair pair;
  int num_inliers = 0;
  int num_pairs = 0;
  EdgeRemoval removal = EdgeRemoval::kKept;
};

// One for each two models that pairs connect, in order of the models.
std::vector<WeakPlace> FindWeakPlaces(const CoarsePoses& poses);

}  // namespace adasfm
