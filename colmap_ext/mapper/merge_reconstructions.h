// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <vector>

#include "colmap_ext/mapper/align_parts.h"
#include "colmap_ext/mapper/local_mapper_scene.h"
#include "core/types.h"

namespace adasfm {

struct MergeSummary {
  // Images whose pose comes from the coarse model, because no fitting part has
  // registered them by points.
  std::set<image_t> coarse_images;
  int num_points = 0;
  // Points of several parts that became one.
  int num_merged_points = 0;
};

// Puts the fitting parts into the scene's reconstruction, which must be empty
// of registered images. An image that several parts have takes the pose of the
// part in which it sees most points. Points of different parts that share an
// observation become one, at the position that explains its observations best;
// where they disagree about an image's keypoint the majority wins. Images of
// the coarse model that no part has by points take their coarse pose relative
// to the neighbours that are there.
MergeSummary MergeParts(const AlignPartsResult& aligned,
                        const std::vector<PartModel>& parts,
                        MapperScene* scene);

}  // namespace adasfm
