// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <vector>

#include "colmap_ext/mapper/align_parts.h"
#include "colmap_ext/mapper/local_mapper_scene.h"
#include "core/types.h"

namespace adasfm {

struct MergeSummary {
  // Images that no fitting part has registered by points: their pose comes from
  // the coarse model, or from a part by its priors.
  std::set<image_t> coarse_images;
  int num_points = 0;
  // Points of several parts that became one.
  int num_merged_points = 0;
};

// Puts the fitting parts into the scene's reconstruction, which must have no
// registered images. An image of several parts takes the pose of the part in
// which it sees most points. Points of different parts that share an
// observation become one, at the position that fits its observations best;
// where they disagree about an image's keypoint, the majority decides. Images
// of the coarse model that no fitting part has take their coarse pose relative
// to registered neighbours.
MergeSummary MergeParts(const AlignPartsResult& aligned,
                        const std::vector<PartModel>& parts,
                        MapperScene* scene);

}  // namespace adasfm
