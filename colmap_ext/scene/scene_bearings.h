// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// One ray per keypoint of every image, under the cameras of the database.
std::map<image_t, std::vector<Bearing>> ComputeSceneBearings(
    const SceneData& scene, int num_threads);

// The same for the registered images of a model, under the model's own cameras,
// which its adjustment may have refined.
std::map<image_t, std::vector<Bearing>> ComputeModelBearings(
    const colmap::Reconstruction& reconstruction, int num_threads);

}  // namespace adasfm
