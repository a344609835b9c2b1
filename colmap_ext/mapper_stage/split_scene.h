// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/mapper/local_mapper_scene.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// A scene split into components, each with its own coarse model.
struct SplitSceneData {
  // One per coarse model, in their order.
  std::vector<SceneData> components;
  // The images of no component, and the pairs and priors among them.
  SceneData rest;
};

// Assigns each image to at most one component, so that every component can be
// mapped by itself and no image is mapped twice. Images with a coarse pose
// belong to that model. The others follow their matches: of all images matched
// to a component, the one with most inliers joins it next. Pairs and priors
// between two components are removed. The scene is moved, not copied; all
// components have all cameras.
SplitSceneData SplitScene(const std::vector<CoarsePoseMap>& coarse_models,
                          SceneData scene);

}  // namespace adasfm
