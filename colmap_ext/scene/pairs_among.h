// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/types.h"

namespace adasfm {

// The pairs of two of these images, in the scene's order. The time depends on
// the number of these images and their pairs, not on the size of the scene.
std::vector<const ScenePair*> FindPairsAmong(const SceneData& scene,
                                             const std::set<image_t>& images);

}  // namespace adasfm
