// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// What: makes one model of adjusted coarse models without metres whose relative
// size their common points tell after all. Before the adjustment pairs did not
// tell it (FindPartsOfOneUnit), or had no direction.
// Inputs: the stage's models and components, in the same order; the verified
// matches of pairs within models and between them.
// Method. Points of each model are triangulated from all of its matches; those
// that images of another model see by a pair that the view graph removed as of
// unknown size or as disconnected give place and size (EstimatePartJoin). Joins
// whose size is known to 5 % are made, the best first, and each new model is
// adjusted as a whole; it takes the parts' place where the verified pairs agree
// with it, and the accelerometer.
// Returns the number of joins made; models that went into another one are left
// empty. On failure: the models stay apart.
int JoinModels(const GlobalStageOptions& options, const SceneData& scene,
               const std::map<image_t, std::vector<Bearing>>& bearings,
               const std::map<ImagePair, std::vector<FeatureMatch>>& matches,
               GlobalStageResult* result);

// Drops empty models, and sorts the rest, largest first.
void SortModels(GlobalStageResult* result);

}  // namespace adasfm
