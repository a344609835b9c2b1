// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>
#include <vector>

#include "colmap_ext/mapper_stage/map_components.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// The coarse models that stage 3 starts from, as adasfm_global wrote them.

// Whether the path is a folder of models 0, 1, ..., and not a model itself.
bool IsFolderOfModels(const std::string& input_path);

// Before any work: an error when there is no coarse model at the path, or when
// writing models to output_path would replace it.
Status CheckCoarseModels(const std::string& input_path,
                         const std::string& output_path);
// The same for a model that is extended.
Status CheckExistingModel(const std::string& path,
                          const std::string& output_path);

struct CoarseModels {
  // Each with its poses and its own part of the scene.
  std::vector<ComponentToMap> components;
  // The images of the models that were passed over.
  std::set<image_t> images_of_small_components;
  // The images of no component.
  SceneData rest;
  std::vector<std::string> warnings;
};

// Reads the model, or all models of the folder in their order, and splits the
// scene among them (SplitScene); the models' cameras replace the scene's. In a
// folder, models of fewer than three images are ignored, since no third image
// tests what two have in common, and so are models without points, which rest
// on the sensors alone; when all are such, the first is taken. An error when an
// image of a model is not in the scene.
StatusOr<CoarseModels> ReadCoarseModels(const std::string& input_path,
                                        SceneData scene);

}  // namespace adasfm
