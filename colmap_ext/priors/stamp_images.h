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

// Finds all images of the scene.
ImageFinder BuildImageFinder(const SceneData& scene);

// Sorts by time, then by image.
void SortByTime(std::vector<ImageStamp>* stamps);

// Returns the times of the images, sorted: from the list at `path` or, without
// one, from image names that are nanoseconds. Counts images without a time in
// `import`, with a warning. An error when no image has a time, or one has two.
StatusOr<std::vector<ImageStamp>> StampImages(const std::string& path,
                                              const SceneData& scene,
                                              PriorImport* import);

}  // namespace adasfm
