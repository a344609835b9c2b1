// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/types.h"

namespace adasfm {

// The pairs of two of these images, in the scene's order; the time depends on
// the images and their pairs, not on the scene's.
std::vector<const ScenePair*> FindPairsAmong(const SceneData& scene,
                                             const std::set<image_t>& images);

}  // namespace adasfm
