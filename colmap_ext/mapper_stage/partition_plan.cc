// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/partition_plan.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "core/option_checker.h"
#include "partition/flood_fill.h"
#include "partition/places.h"

namespace adasfm {
namespace {

// A prior connects two images about as well as a weak pair; parts are cut
// through vision rather than through the priors of a tunnel.
constexpr double kPriorWeight = 30.0;

std::vector<std::vector<image_t>> ImagesOfPlaces(
    const std::map<image_t, image_t>& place_of_image,
    const std::vector<std::vector<image_t>>& parts_of_places) {
  std::map<image_t, std::vector<image_t>> images_of_place;
  for (const auto& [image_id, place] : place_of_image) {
    images_of_place[place].push_back(image_id);
  }
  std::vector<std::vector<image_t>> parts;
  for (const std::vector<image_t>& places : parts_of_places) {
    std::vector<image_t>& part = parts.emplace_back();
    for (const image_t place : places) {
      const std::vector<image_t>& images = images_of_place.at(place);
      part.insert(part.end(), images.begin(), images.end());
    }
    std::sort(part.begin(), part.end());
  }
  return parts;
}

}  // namespace

bool PartitionPlanOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmPartition", error)
             .AtLeast(2, "max_num_images_undivided", max_num_images_undivided)
             .Require(min_overlap_ratio >= 0.0 && min_overlap_ratio < 1.0,
                      "min_overlap_ratio", min_overlap_ratio,
                      "must be in [0, 1)")
             .AllHold() &&
         cut.IsValid(error);
}

ImageGraph BuildImageGraph(const SceneData& data, const CoarsePoseMap& coarse) {
  ImageGraph graph;
  for (const auto& [image_id, pose] : coarse) {
    if (data.images.count(image_id)) graph.images.insert(image_id);
  }
  const auto add_edge = [&graph](image_t a, image_t b, double weight) {
    graph.images.insert(a);
    graph.images.insert(b);
    graph.edges[ImagePair(a, b)] += weight;
  };
  for (const ScenePair& pair : data.pairs) {
    if (pair.inlier_matches.empty()) continue;
    add_edge(pair.image_id1, pair.image_id2,
             static_cast<double>(pair.inlier_matches.size()));
  }
  for (const RelativePosePrior& prior : data.priors) {
    if (!graph.images.count(prior.image_id1) ||
        !graph.images.count(prior.image_id2)) {
      continue;
    }
    add_edge(prior.image_id1, prior.image_id2, kPriorWeight);
  }
  return graph;
}

PartitionPlan BuildPartitionPlan(const PartitionPlanOptions& options,
                                 const SceneData& data,
                                 const CoarsePoseMap& coarse) {
  const ImageGraph graph = BuildImageGraph(data, coarse);
  std::map<image_t, Eigen::Vector3d> positions;
  for (const auto& [image_id, pose] : coarse) {
    positions[image_id] = pose.TargetOriginInSource();
  }
  const auto place_of_image = FindPlaces(graph, positions);
  const ImageGraph places = MergePlaces(graph, place_of_image);
  PartitionPlan plan;
  const int num_places = static_cast<int>(places.images.size());
  if (num_places <= options.max_num_images_undivided) {
    plan.parts.emplace_back(graph.images.begin(), graph.images.end());
  } else {
    plan.parts = ImagesOfPlaces(
        place_of_image,
        ExpandByFloodFill(options.min_overlap_ratio, places,
                          ComputeNormalizedCut(options.cut, places)));
  }
  plan.overlap_ratios = ComputeOverlapRatios(plan.parts);
  return plan;
}

Status WritePartitionPlan(const std::string& path,
                          const std::string& fingerprint,
                          const PartitionPlan& plan) {
  return WriteCheckpointFile(
      path, fingerprint,
      {{"parts", plan.parts}, {"overlap_ratios", plan.overlap_ratios}});
}

StatusOr<PartitionPlan> ReadPartitionPlan(const std::string& path,
                                          const std::string& fingerprint,
                                          CheckpointCondition* condition) {
  const CheckpointFile file = ReadCheckpointFile(path, fingerprint);
  if (condition != nullptr) *condition = file.condition;
  if (file.condition != CheckpointCondition::kSound) {
    return Status::Error(file.problem +
                         "; run --AdaSfmMapper.stage plan first");
  }
  try {
    PartitionPlan plan;
    file.content.at("parts").get_to(plan.parts);
    file.content.at("overlap_ratios").get_to(plan.overlap_ratios);
    return plan;
  } catch (const nlohmann::json::exception&) {
    if (condition != nullptr) *condition = CheckpointCondition::kDamaged;
    return Status::Error(path + " is damaged; run --AdaSfmMapper.stage plan");
  }
}

}  // namespace adasfm
