// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// Joins adjusted coarse models without metres whose relative scale follows from
// common points. Before the adjustment pairs did not determine it
// (FindPartsOfOneUnit), or had no direction.
// Inputs: the stage's models and components, in the same order; the verified
// matches of pairs within models and between them.
// Method: points of each model are triangulated from all of its matches. Those
// that images of another model observe, by a pair that the view graph removed
// as of unknown size or as disconnected, determine place and scale
// (EstimatePartJoin). Joins whose scale is known to 5 % are made, the best
// first, and each new model is adjusted as a whole. It replaces the joined
// models where the verified pairs and the accelerometer agree with it.
// Returns the number of joins made; models that went into another one are left
// empty. On failure the models stay apart.
int JoinModels(const GlobalStageOptions& options, const SceneData& scene,
               const std::map<image_t, std::vector<Bearing>>& bearings,
               const std::map<ImagePair, std::vector<FeatureMatch>>& matches,
               GlobalStageResult* result);

// Removes empty models and sorts the others, largest first.
void SortModels(GlobalStageResult* result);

}  // namespace adasfm
