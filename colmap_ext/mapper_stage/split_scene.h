// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/mapper/local_mapper_scene.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// A scene that falls apart into components, each with a coarse model of its
// own.
struct SplitSceneData {
  // One per coarse model, in their order.
  std::vector<SceneData> components;
  // The images that belong to none, and what lies between them.
  SceneData rest;
};

// Gives each image to the component that can use it, so that every component
// can be mapped by itself and no image is mapped twice. Images with a coarse
// pose are of that model; the others follow their matches: of all images that
// are matched to a component, the one with most inliers joins it next. Pairs
// and priors between two components are dropped. The scene is moved, not
// copied; cameras are in all.
SplitSceneData SplitScene(const std::vector<CoarsePoseMap>& coarse_models,
                          SceneData scene);

}  // namespace adasfm
