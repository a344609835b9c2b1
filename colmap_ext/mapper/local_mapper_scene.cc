// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/local_mapper_scene.h"

#include <algorithm>
#include <utility>

#include "colmap_ext/scene/pairs_among.h"

namespace adasfm {
namespace {

void AddImages(const SceneData& data, MapperScene* scene) {
  std::set<camera_t> cameras;
  for (const image_t image_id : scene->images) {
    const SceneImage& source = data.images.at(image_id);
    if (cameras.insert(source.camera_id).second) {
      scene->mapper.AddCamera(data.cameras.at(source.camera_id));
    }
    scene->mapper.AddImage(image_id, source.name, source.camera_id,
                           source.keypoints);
    scene->neighbors[image_id];
  }
}

void AddMatches(const SceneData& data, bool with_matches, MapperScene* scene) {
  for (const ScenePair* pair : FindPairsAmong(data, scene->images)) {
    if (with_matches) {
      scene->mapper.AddMatches(pair->image_id1, pair->image_id2,
                               pair->inlier_matches);
    }
    const int num_matches = static_cast<int>(pair->inlier_matches.size());
    scene->neighbors[pair->image_id1].emplace_back(pair->image_id2,
                                                   num_matches);
    scene->neighbors[pair->image_id2].emplace_back(pair->image_id1,
                                                   num_matches);
  }
  for (auto& [image_id, neighbors] : scene->neighbors) {
    std::stable_sort(
        neighbors.begin(), neighbors.end(),
        [](const auto& a, const auto& b) { return a.second > b.second; });
  }
}

void AddPriors(const std::vector<RelativePosePrior>& priors,
               MapperScene* scene) {
  for (const RelativePosePrior& prior : priors) {
    if (!scene->images.count(prior.image_id1) ||
        !scene->images.count(prior.image_id2)) {
      continue;
    }
    scene->priors_of_image[prior.image_id1].push_back(scene->priors.size());
    scene->priors_of_image[prior.image_id2].push_back(scene->priors.size());
    scene->priors.push_back(prior);
  }
}

}  // namespace

std::unique_ptr<MapperScene> BuildMapperScene(const SceneData& data,
                                              const CoarsePoseMap& coarse,
                                              const std::set<image_t>& images,
                                              bool with_matches) {
  auto scene = std::make_unique<MapperScene>();
  scene->data = &data;
  scene->coarse = &coarse;
  for (const image_t image_id : images) {
    if (data.images.count(image_id)) scene->images.insert(image_id);
  }
  AddImages(data, scene.get());
  AddMatches(data, with_matches, scene.get());
  scene->mapper.Begin();
  if (!with_matches) scene->mapper.ReleaseMatches();
  AddPriors(data.priors, scene.get());
  AddPriors(data.frame_priors, scene.get());
  return scene;
}

}  // namespace adasfm
