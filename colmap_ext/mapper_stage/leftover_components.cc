// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/leftover_components.h"

#include <map>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper_stage/split_scene.h"
#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// Fewer images are a loss at the ends of a model, not a trajectory segment.
constexpr size_t kMinNumImages = 10;

// The coarse poses of the images that are not in the model, by component.
std::vector<CoarsePoseMap> FindStretches(const ComponentToMap& component,
                                         const colmap::Reconstruction& model) {
  const CoarsePoseMap& coarse = component.coarse;
  std::map<image_t, int> indices;
  for (const auto& [image_id, pose] : coarse) {
    if (model.ExistsImage(image_id) && IsRegistered(model, image_id)) continue;
    indices.emplace(image_id, static_cast<int>(indices.size()));
  }
  DisjointSets sets(indices.size());
  for (const ScenePair& pair : component.data.pairs) {
    const auto first = indices.find(pair.image_id1);
    const auto second = indices.find(pair.image_id2);
    if (first == indices.end() || second == indices.end() ||
        pair.inlier_matches.empty()) {
      continue;
    }
    sets.Join(first->second, second->second);
  }
  std::map<int, CoarsePoseMap> by_set;
  for (const auto& [image_id, index] : indices) {
    by_set[sets.Find(index)].emplace(image_id, coarse.at(image_id));
  }
  std::vector<CoarsePoseMap> stretches;
  for (auto& [set, poses] : by_set) {
    if (poses.size() >= kMinNumImages) stretches.push_back(std::move(poses));
  }
  return stretches;
}

// Copies the frame priors, which SplitScene leaves to its callers.
void AddFramePriors(const std::vector<RelativePosePrior>& frame_priors,
                    SceneData* data) {
  for (const RelativePosePrior& prior : frame_priors) {
    if (data->images.count(prior.image_id1) > 0 &&
        data->images.count(prior.image_id2) > 0) {
      data->frame_priors.push_back(prior);
    }
  }
}

void TakeLeftoversOf(const colmap::Reconstruction& model, size_t index,
                     std::vector<ComponentToMap>* components) {
  const std::vector<CoarsePoseMap> stretches =
      FindStretches((*components)[index], model);
  if (stretches.empty()) return;
  std::vector<CoarsePoseMap> poses(1);
  for (const image_t image_id : RegisteredImages(model)) {
    poses[0].emplace(image_id, CamFromWorld(model.Image(image_id)));
  }
  poses.insert(poses.end(), stretches.begin(), stretches.end());
  const std::vector<RelativePosePrior> frame_priors =
      (*components)[index].data.frame_priors;
  SplitSceneData split =
      SplitScene(poses, std::move((*components)[index].data));
  for (size_t k = 1; k < poses.size(); ++k) {
    const ComponentToMap& source = (*components)[index];
    ComponentToMap leftover{source.coarse_index, std::move(poses[k]),
                            std::move(split.components[k]),
                            source.initial_position_loss_scale};
    AddFramePriors(frame_priors, &leftover.data);
    for (auto& [camera_id, camera] : leftover.data.cameras) {
      if (model.ExistsCamera(camera_id)) camera = model.Camera(camera_id);
    }
    components->push_back(std::move(leftover));
  }
  ComponentToMap& source = (*components)[index];
  for (const CoarsePoseMap& stretch : stretches) {
    for (const auto& [image_id, pose] : stretch) source.coarse.erase(image_id);
  }
  source.data = std::move(split.components[0]);
  source.data.images.merge(split.rest.images);
  AddFramePriors(frame_priors, &source.data);
}

}  // namespace

void TakeLeftovers(const std::vector<MappedComponent>& mapped,
                   std::vector<ComponentToMap>* components) {
  for (const MappedComponent& component : mapped) {
    if (component.model.NumRegImages() == 0) continue;
    TakeLeftoversOf(component.model, component.component, components);
  }
}

}  // namespace adasfm
