// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// Step 8 of the coarse global stage: RefineMatches on the pairs within every
// model of the result, under the model's poses and, where its adjustment has
// refined them, its cameras (else the bearings of the scene). Fills the
// result's refinement, geometries and removed_pairs; pairs that the view graph
// refuted and pairs between two models are removed ones.
void RefineStageMatches(const GlobalStageOptions& options,
                        const SceneData& scene,
                        const std::map<image_t, std::vector<Bearing>>& bearings,
                        GlobalStageResult* result);

}  // namespace adasfm
