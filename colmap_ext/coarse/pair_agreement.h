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
  // The same of the pairs of one image, where it is least: a world bent by
  // look-alike places fits nearly everywhere, but not where it is bent.
  double least_image_share = 1.0;

  // Whether no bend shows: an image beside one loses its pairs to one side,
  // half of them.
  bool IsSound() const { return share >= 0.8 && least_image_share >= 0.7; }
};

// What: how far vision agrees with the poses of one model after its adjustment.
// Method: a pair fits when half of its verified matches do, by the rule of
// match refinement; pairs that the stage removed as off the rotations or the
// positions count too, others that it refuted do not.
// On failure: without pairs all of none fit.
PairAgreement MeasurePairAgreement(
    const MatchRefinementOptions& options, const SceneData& scene,
    const ViewGraph& graph, const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings);

}  // namespace adasfm
