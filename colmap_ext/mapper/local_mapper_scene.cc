// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/local_mapper_scene.h"

#include <algorithm>
#include <utility>

namespace adasfm {
namespace {

void AddImages(const SceneData& data, MapperScene* scene) {
  std::set<camera_t> cameras;
  for (const image_t image_id : scene->images) {
    const SceneImage& source = data.images.at(image_id);
    if (cameras.insert(source.camera_id).second) {
      scene->reconstruction.AddCamera(data.cameras.at(source.camera_id));
    }
    colmap::Image image;
    image.SetImageId(image_id);
    image.SetName(source.name);
    image.SetCameraId(source.camera_id);
    image.SetPoints2D(source.keypoints);
    scene->reconstruction.AddImage(std::move(image));
    scene->graph.AddImage(image_id, source.keypoints.size());
    scene->neighbors[image_id];
  }
}

void AddMatches(const SceneData& data, MapperScene* scene) {
  for (const ScenePair& pair : data.pairs) {
    if (!scene->images.count(pair.image_id1) ||
        !scene->images.count(pair.image_id2)) {
      continue;
    }
    colmap::FeatureMatches matches;
    matches.reserve(pair.inlier_matches.size());
    for (const FeatureMatch& match : pair.inlier_matches) {
      matches.emplace_back(match.point2D_idx1, match.point2D_idx2);
    }
    scene->graph.AddCorrespondences(pair.image_id1, pair.image_id2, matches);
    const int num_matches = static_cast<int>(matches.size());
    scene->neighbors[pair.image_id1].emplace_back(pair.image_id2, num_matches);
    scene->neighbors[pair.image_id2].emplace_back(pair.image_id1, num_matches);
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
                                              const std::set<image_t>& images) {
  auto scene = std::make_unique<MapperScene>();
  scene->data = &data;
  scene->coarse = &coarse;
  for (const image_t image_id : images) {
    if (data.images.count(image_id)) scene->images.insert(image_id);
  }
  AddImages(data, scene.get());
  AddMatches(data, scene.get());
  AddPriors(data.priors, scene.get());
  AddPriors(data.frame_priors, scene.get());
  return scene;
}

std::vector<VisiblePoint> FindVisiblePoints(const MapperScene& scene,
                                            image_t image_id) {
  const colmap::Image& image = scene.reconstruction.Image(image_id);
  std::vector<VisiblePoint> visible_points;
  std::vector<colmap::point3D_t> seen;
  for (point2D_t idx = 0; idx < image.NumPoints2D(); ++idx) {
    seen.clear();
    for (const auto& correspondence :
         scene.graph.FindCorrespondences(image_id, idx)) {
      const colmap::Image& other =
          scene.reconstruction.Image(correspondence.image_id);
      if (!other.IsRegistered()) continue;
      const colmap::Point2D& point2D =
          other.Point2D(correspondence.point2D_idx);
      if (point2D.HasPoint3D()) seen.push_back(point2D.Point3DId());
    }
    if (seen.empty()) continue;
    std::sort(seen.begin(), seen.end());
    size_t best_begin = 0;
    size_t best_count = 0;
    for (size_t begin = 0; begin < seen.size();) {
      size_t end = begin;
      while (end < seen.size() && seen[end] == seen[begin]) ++end;
      if (end - begin > best_count) {
        best_begin = begin;
        best_count = end - begin;
      }
      begin = end;
    }
    visible_points.push_back({idx, seen[best_begin]});
  }
  return visible_points;
}

}  // namespace adasfm
