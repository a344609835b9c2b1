// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// What: takes adjusted coarse models without metres apart where nothing tells
// the place of one part against the rest (FindUntiedParts): pairs held the
// model together before the adjustment, which found their matches wrong. And
// where an accelerometer puts a part elsewhere (FindPartsByInertia).
// Inputs: the stage's models and components, in the same order; the verified
// matches of the pairs that the view graph keeps.
// Method. Each part is adjusted by itself, from its present poses; pairs
// between parts are removed as of unknown size, and JoinModels may try them.
// Returns the number of models that were added, at the end.
int SplitModels(const GlobalStageOptions& options, const SceneData& scene,
                const std::map<image_t, std::vector<Bearing>>& bearings,
                const std::map<ImagePair, std::vector<FeatureMatch>>& matches,
                GlobalStageResult* result);

}  // namespace adasfm
