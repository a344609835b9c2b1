// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/covisibility.h"

#include <algorithm>

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {
namespace {

// Lists of numbers, one behind the other.
struct Lists {
  std::vector<size_t> begin = {0};
  std::vector<int> values;
};

// Of each number in the lists, those of the lists that have it.
Lists Invert(const Lists& lists, size_t num_values) {
  Lists inverse;
  inverse.begin.assign(num_values + 1, 0);
  for (const int value : lists.values) ++inverse.begin[value + 1];
  for (size_t k = 0; k < num_values; ++k) {
    inverse.begin[k + 1] += inverse.begin[k];
  }
  inverse.values.resize(lists.values.size());
  std::vector<size_t> end = inverse.begin;
  for (size_t list = 0; list + 1 < lists.begin.size(); ++list) {
    for (size_t k = lists.begin[list]; k < lists.begin[list + 1]; ++k) {
      inverse.values[end[lists.values[k]]++] = static_cast<int>(list);
    }
  }
  return inverse;
}

}  // namespace

Covisibility::Covisibility(const std::set<image_t>& images,
                           const colmap::Reconstruction& reconstruction,
                           int min_num_shared_points) {
  for (const image_t image_id : images) {
    index_of_.emplace(image_id, static_cast<int>(index_of_.size()));
  }
  neighbors_.resize(images.size());
  num_shared_.resize(images.size());
  // An image of a point once for each of its keypoints.
  Lists images_of;
  for (const auto& [point_id, point] : reconstruction.Points3D()) {
    for (const auto& element : TrackOf(point).Elements()) {
      const int index = IndexOf(element.image_id);
      if (index >= 0) images_of.values.push_back(index);
    }
    images_of.begin.push_back(images_of.values.size());
  }
  const Lists points_of = Invert(images_of, images.size());
  std::vector<int> num_shared(images.size(), 0);
  for (size_t index = 0; index < images.size(); ++index) {
    std::vector<int>& neighbors = neighbors_[index];
    for (size_t k = points_of.begin[index]; k < points_of.begin[index + 1];
         ++k) {
      const int point = points_of.values[k];
      for (size_t i = images_of.begin[point]; i < images_of.begin[point + 1];
           ++i) {
        const int other = images_of.values[i];
        if (other <= static_cast<int>(index)) continue;
        if (++num_shared[other] == 1) neighbors.push_back(other);
      }
    }
    std::sort(neighbors.begin(), neighbors.end());
    for (const int other : neighbors) {
      num_shared_[index].push_back(num_shared[other]);
      num_shared[other] = 0;
    }
  }
  Cut(min_num_shared_points);
}

void Covisibility::Cut(int min_num_shared_points) {
  for (size_t index = 0; index < neighbors_.size(); ++index) {
    size_t num_kept = 0;
    for (size_t k = 0; k < neighbors_[index].size(); ++k) {
      if (num_shared_[index][k] < min_num_shared_points) continue;
      neighbors_[index][num_kept] = neighbors_[index][k];
      num_shared_[index][num_kept++] = num_shared_[index][k];
    }
    neighbors_[index].resize(num_kept);
    num_shared_[index].resize(num_kept);
  }
}

int Covisibility::IndexOf(image_t image_id) const {
  const auto found = index_of_.find(image_id);
  return found == index_of_.end() ? -1 : found->second;
}

bool Covisibility::SharePoints(int index1, int index2) const {
  if (index1 == index2 || index1 < 0 || index2 < 0) return true;
  const std::vector<int>& neighbors = neighbors_[std::min(index1, index2)];
  return std::binary_search(neighbors.begin(), neighbors.end(),
                            std::max(index1, index2));
}

std::vector<int> Covisibility::CutTrack(
    const std::vector<image_t>& images) const {
  std::vector<std::vector<int>> groups;
  std::vector<int> group_of;
  for (const image_t image_id : images) {
    const int index = IndexOf(image_id);
    const auto group = std::find_if(
        groups.begin(), groups.end(), [&](const std::vector<int>& members) {
          return std::all_of(members.begin(), members.end(), [&](int other) {
            return SharePoints(other, index);
          });
        });
    group_of.push_back(static_cast<int>(group - groups.begin()));
    if (group == groups.end()) groups.emplace_back();
    groups[group_of.back()].push_back(index);
  }
  return group_of;
}

}  // namespace adasfm
