// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// Splits adjusted coarse models without metres where nothing determines the
// place of a part relative to the others (FindUntiedParts): pairs connected the
// parts before the adjustment, which found their matches wrong. Also splits
// where an accelerometer contradicts the place of a part (FindPartsByInertia).
// Inputs: the stage's models and components, in the same order; the verified
// matches of the pairs that the view graph keeps.
// Method: each part is adjusted by itself, from its present poses. Pairs
// between parts are removed as of unknown size, and JoinModels may try them.
// Returns the number of models that were added, at the end.
int SplitModels(const GlobalStageOptions& options, const SceneData& scene,
                const std::map<image_t, std::vector<Bearing>>& bearings,
                const std::map<ImagePair, std::vector<FeatureMatch>>& matches,
                GlobalStageResult* result);

}  // namespace adasfm
