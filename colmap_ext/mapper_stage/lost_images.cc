// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/lost_images.h"

#include <algorithm>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

namespace adasfm {
namespace {

// Names per reason in a line for the screen; the summary has them all.
constexpr size_t kMaxNumNames = 3;

void AppendLost(const SceneData& data, const std::set<image_t>& mapped_images,
                const std::function<LostReason(image_t)>& reason_of,
                std::vector<LostImage>* lost) {
  for (const auto& [image_id, image] : data.images) {
    if (mapped_images.count(image_id) > 0) continue;
    lost->push_back({image_id, image.name, reason_of(image_id)});
  }
}

}  // namespace

std::vector<LostImage> FindLostImages(
    const std::vector<ComponentToMap>& components, const SceneData& rest,
    const std::set<image_t>& images_of_small_components,
    const std::set<image_t>& matched_images,
    const std::set<image_t>& mapped_images) {
  std::vector<LostImage> lost;
  const auto without_pose = [&](image_t image_id) {
    if (images_of_small_components.count(image_id) > 0) {
      return LostReason::kSmallComponent;
    }
    return matched_images.count(image_id) > 0 ? LostReason::kCoarseStage
                                              : LostReason::kNoMatches;
  };
  for (const ComponentToMap& component : components) {
    AppendLost(
        component.data, mapped_images,
        [&](image_t image_id) {
          return component.coarse.count(image_id) > 0 ? LostReason::kMapping
                                                      : without_pose(image_id);
        },
        &lost);
  }
  AppendLost(rest, mapped_images, without_pose, &lost);
  std::sort(
      lost.begin(), lost.end(), [](const LostImage& a, const LostImage& b) {
        return std::tie(a.name, a.image_id) < std::tie(b.name, b.image_id);
      });
  return lost;
}

const char* DescribeLostReason(LostReason reason) {
  switch (reason) {
    case LostReason::kNoMatches:
      return "without verified matches";
    case LostReason::kCoarseStage:
      return "left out by the coarse stage";
    case LostReason::kSmallComponent:
      return "in a coarse model too small to be mapped";
    case LostReason::kMapping:
      break;
  }
  return "lost while registering";
}

std::string DescribeLostImages(const std::vector<LostImage>& images) {
  std::map<LostReason, std::vector<std::string>> names;
  for (const LostImage& image : images) {
    names[image.reason].push_back(image.name);
  }
  std::string text;
  for (const auto& [reason, list] : names) {
    if (!text.empty()) text += ", ";
    text += std::to_string(list.size()) + " " + DescribeLostReason(reason);
    for (size_t i = 0; i < std::min(kMaxNumNames, list.size()); ++i) {
      text += (i == 0 ? " (" : ", ") + list[i];
    }
    text += list.size() > kMaxNumNames ? ", ...)" : ")";
  }
  return text;
}

nlohmann::json LostImagesToJson(const std::vector<LostImage>& images) {
  nlohmann::json json = nlohmann::json::array();
  for (const LostImage& image : images) {
    json.push_back(
        {{"name", image.name}, {"reason", DescribeLostReason(image.reason)}});
  }
  return json;
}

}  // namespace adasfm
