// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/mapper_stage/map_components.h"
#include "core/types.h"

namespace adasfm {

// The images of a database that no model has, and why.

// In the order of the stages.
enum class LostReason {
  kNoMatches,       // no pair of theirs was verified
  kCoarseStage,     // matches, but no place in a coarse model
  kSmallComponent,  // their coarse model is too small to be mapped
  kMapping,         // a coarse pose, but none in the end
};

struct LostImage {
  image_t image_id = kInvalidImageId;
  std::string name;
  LostReason reason = LostReason::kNoMatches;
};

// Inputs: the mapped components and the rest of the scene, the images of coarse
// models that were too small, the images with matches in the database before
// adasfm_global removed some, and the images of the finished models. Sorted by
// name.
std::vector<LostImage> FindLostImages(
    const std::vector<ComponentToMap>& components, const SceneData& rest,
    const std::set<image_t>& images_of_small_components,
    const std::set<image_t>& matched_images,
    const std::set<image_t>& mapped_images);

// "without verified matches" and the like, to follow a number of images.
const char* DescribeLostReason(LostReason reason);

// Numbers by reason, with the first names of each; empty without lost images.
std::string DescribeLostImages(const std::vector<LostImage>& images);

// [{"name", "reason"}].
nlohmann::json LostImagesToJson(const std::vector<LostImage>& images);

}  // namespace adasfm
