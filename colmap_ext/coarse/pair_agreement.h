// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/rigid3d.h"
#include "core/types.h"
#include "global/structure/match_refinement.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Shares of the verified pairs that fit poses.
struct PairAgreement {
  double share = 1.0;
  // The smallest share among the pairs of single images: a model deformed by
  // aliased pairs fits nearly everywhere, but not at the deformation.
  double least_image_share = 1.0;

  // Whether no deformation shows: an image beside one loses the pairs to one
  // side, half of its pairs.
  bool IsSound() const { return share >= 0.8 && least_image_share >= 0.7; }
};

// Measures how far vision agrees with the poses of one model after its
// adjustment. A pair fits when half of its verified matches do, by the rule of
// match refinement. Pairs that the stage removed because they contradict the
// rotations or the positions count, too; other removed pairs do not. Without
// pairs the shares are 1.
PairAgreement MeasurePairAgreement(
    const MatchRefinementOptions& options, const SceneData& scene,
    const ViewGraph& graph, const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings);

}  // namespace adasfm
