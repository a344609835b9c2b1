// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/covisibility.h"

#include <algorithm>

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {

Covisibility::Covisibility(const std::set<image_t>& images,
                           const colmap::Reconstruction& reconstruction,
                           int min_num_shared_points) {
  for (const image_t image_id : images) {
    index_of_.emplace(image_id, static_cast<int>(index_of_.size()));
  }
  neighbors_.resize(images.size());
  std::vector<int> num_shared(images.size(), 0);
  std::vector<int> others;
  for (const image_t image_id : images) {
    const int index = index_of_.at(image_id);
    if (!reconstruction.ExistsImage(image_id)) continue;
    others.clear();
    for (const auto& point2D : reconstruction.Image(image_id).Points2D()) {
      if (!point2D.HasPoint3D()) continue;
      const auto& point = reconstruction.Point3D(PointIdOf(point2D));
      for (const auto& element : TrackOf(point).Elements()) {
        const auto other = index_of_.find(element.image_id);
        if (other == index_of_.end() || other->second <= index) continue;
        if (++num_shared[other->second] == 1) others.push_back(other->second);
      }
    }
    for (const int other : others) {
      if (num_shared[other] >= min_num_shared_points) {
        neighbors_[index].push_back(other);
      }
      num_shared[other] = 0;
    }
    std::sort(neighbors_[index].begin(), neighbors_[index].end());
  }
}

bool Covisibility::SharePoints(image_t image_id1, image_t image_id2) const {
  const auto index1 = index_of_.find(std::min(image_id1, image_id2));
  const auto index2 = index_of_.find(std::max(image_id1, image_id2));
  if (index1 == index2 || index1 == index_of_.end() ||
      index2 == index_of_.end()) {
    return true;
  }
  const std::vector<int>& neighbors = neighbors_[index1->second];
  return std::binary_search(neighbors.begin(), neighbors.end(), index2->second);
}

std::vector<int> Covisibility::CutTrack(
    const std::vector<image_t>& images) const {
  std::vector<std::vector<image_t>> groups;
  std::vector<int> group_of;
  for (const image_t image_id : images) {
    const auto group = std::find_if(
        groups.begin(), groups.end(), [&](const std::vector<image_t>& members) {
          return std::all_of(
              members.begin(), members.end(),
              [&](image_t other) { return SharePoints(other, image_id); });
        });
    group_of.push_back(static_cast<int>(group - groups.begin()));
    if (group == groups.end()) groups.emplace_back();
    groups[group_of.back()].push_back(image_id);
  }
  return group_of;
}

}  // namespace adasfm
