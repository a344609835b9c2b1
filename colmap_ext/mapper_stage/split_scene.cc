// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/split_scene.h"

#include <map>
#include <queue>
#include <tuple>
#include <utility>

namespace adasfm {
namespace {

constexpr int kNoComponent = -1;

// An image that may join a component. Most inliers come first, then the
// smallest ids.
struct Candidate {
  size_t num_inliers = 0;
  image_t image_id = kInvalidImageId;
  int component = kNoComponent;

  bool operator<(const Candidate& other) const {
    return std::tie(num_inliers, other.image_id, other.component) <
           std::tie(other.num_inliers, image_id, component);
  }
};

// The component of each image that has one.
std::map<image_t, int> FindComponents(
    const std::vector<CoarsePoseMap>& coarse_models, const SceneData& scene) {
  std::map<image_t, std::vector<std::pair<image_t, size_t>>> neighbors;
  for (const ScenePair& pair : scene.pairs) {
    if (pair.inlier_matches.empty()) continue;
    neighbors[pair.image_id1].push_back(
        {pair.image_id2, pair.inlier_matches.size()});
    neighbors[pair.image_id2].push_back(
        {pair.image_id1, pair.inlier_matches.size()});
  }
  std::map<image_t, int> components;
  std::priority_queue<Candidate> candidates;
  const auto add = [&](image_t image_id, int component) {
    if (!components.emplace(image_id, component).second) return;
    for (const auto& [neighbor, num_inliers] : neighbors[image_id]) {
      if (components.count(neighbor) > 0) continue;
      candidates.push({num_inliers, neighbor, component});
    }
  };
  for (size_t k = 0; k < coarse_models.size(); ++k) {
    for (const auto& [image_id, pose] : coarse_models[k]) {
      add(image_id, static_cast<int>(k));
    }
  }
  while (!candidates.empty()) {
    const Candidate next = candidates.top();
    candidates.pop();
    add(next.image_id, next.component);
  }
  return components;
}

}  // namespace

SplitSceneData SplitScene(const std::vector<CoarsePoseMap>& coarse_models,
                          SceneData scene) {
  const std::map<image_t, int> components =
      FindComponents(coarse_models, scene);
  const auto component_of = [&components](image_t image_id) {
    const auto it = components.find(image_id);
    return it == components.end() ? kNoComponent : it->second;
  };
  SplitSceneData split;
  split.components.resize(coarse_models.size());
  const auto scene_of = [&split](int component) {
    return component == kNoComponent ? &split.rest
                                     : &split.components[component];
  };
  for (auto& [image_id, image] : scene.images) {
    scene_of(component_of(image_id))
        ->images.emplace(image_id, std::move(image));
  }
  for (ScenePair& pair : scene.pairs) {
    const int component = component_of(pair.image_id1);
    if (component != component_of(pair.image_id2)) continue;
    scene_of(component)->pairs.push_back(std::move(pair));
  }
  for (const RelativePosePrior& prior : scene.priors) {
    const int component = component_of(prior.image_id1);
    if (component != component_of(prior.image_id2)) continue;
    scene_of(component)->priors.push_back(prior);
  }
  for (const InertialMotion& motion : scene.inertial_motions) {
    const int component = component_of(motion.image_id1);
    if (component != component_of(motion.image_id2)) continue;
    scene_of(component)->inertial_motions.push_back(motion);
  }
  for (const auto& [image_id, image] : scene.rigs.images) {
    scene_of(component_of(image_id))->rigs.images[image_id] = image;
  }
  for (const PositionPrior& position : scene.positions) {
    const int component = component_of(position.image_id1);
    if (component != component_of(position.image_id2)) continue;
    scene_of(component)->positions.push_back(position);
  }
  for (SceneData& component : split.components) {
    component.cameras = scene.cameras;
    component.rigs.cameras = scene.rigs.cameras;
    component.position_origin = scene.position_origin;
    component.length_drift_ratio = scene.length_drift_ratio;
    component.wheel_scale = scene.wheel_scale;
    component.inertial_scale_sigma = scene.inertial_scale_sigma;
  }
  split.rest.cameras = std::move(scene.cameras);
  split.rest.warnings = std::move(scene.warnings);
  return split;
}

}  // namespace adasfm
