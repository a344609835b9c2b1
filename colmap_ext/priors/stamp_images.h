// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/priors/prior_importer.h"
#include "colmap_ext/scene/image_finder.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"
#include "sensors/estimate_priors.h"

namespace adasfm {

// Of all images of the scene.
ImageFinder BuildImageFinder(const SceneData& scene);

// By time, then by image.
void SortByTime(std::vector<ImageStamp>* stamps);

// What: the times of the images, sorted: of the list at path or, without one,
// the nanoseconds that are the images' names. Images without a time are counted
// in import, and warned of.
// On failure: an error when no image has a time, or one has two.
StatusOr<std::vector<ImageStamp>> StampImages(const std::string& path,
                                              const SceneData& scene,
                                              PriorImport* import);

}  // namespace adasfm
