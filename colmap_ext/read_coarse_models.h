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

// A path is that of one model, or of the folder that holds 0, 1, ...
bool IsFolderOfModels(const std::string& input_path);

// Before any work: an error when there is no coarse model at the path, or when
// writing models to output_path would replace it.
Status CheckCoarseModels(const std::string& input_path,
                         const std::string& output_path);

struct CoarseModels {
  // Each with its poses, and the part of the scene that is its own.
  std::vector<ComponentToMap> components;
  // The images of the models that were passed over.
  std::set<image_t> images_of_small_components;
  // The images of no component.
  SceneData rest;
  std::vector<std::string> warnings;
};

// Reads the model, or all models of the folder in their order, and cuts the
// scene into theirs (SplitScene); their cameras become the scenes'. Of a
// folder, models of fewer than three images are passed over, since no third
// image tests what two have in common, and so are models without points, which
// the sensors alone hold; when all are such, the first is taken. An error when
// a model's images are not the scene's.
StatusOr<CoarseModels> ReadCoarseModels(const std::string& input_path,
                                        SceneData scene);

}  // namespace adasfm
