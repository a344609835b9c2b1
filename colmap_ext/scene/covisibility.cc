// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/covisibility.h"

#include <algorithm>

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {
namespace {

constexpr int kNumNear = 64;  // Bits of near_.

// Whether two sorted lists have a common entry.
bool Intersect(const std::vector<int>& list1, const std::vector<int>& list2) {
  auto entry = list1.begin();
  return std::any_of(list2.begin(), list2.end(), [&](int wanted) {
    entry = std::lower_bound(entry, list1.end(), wanted);
    return entry != list1.end() && *entry == wanted;
  });
}

}  // namespace

Covisibility::Covisibility(const std::set<image_t>& images,
                           const colmap::Reconstruction& reconstruction,
                           int min_num_shared_points)
    : images_(images.begin(), images.end()) {
  neighbors_.resize(images.size());
  num_shared_.resize(images.size());
  near_.resize(images.size());
  std::vector<int> num_shared(images.size(), 0);
  for (const image_t image_id : images) {
    if (!reconstruction.ExistsImage(image_id)) continue;
    const int index = IndexOf(image_id);
    std::vector<int>& neighbors = neighbors_[index];
    for (const auto& point2D : reconstruction.Image(image_id).Points2D()) {
      if (!point2D.HasPoint3D()) continue;
      const auto& point = reconstruction.Point3D(PointIdOf(point2D));
      for (const auto& element : TrackOf(point).Elements()) {
        const int other = IndexOf(element.image_id);
        if (other <= index) continue;
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

template <typename Function>
void Covisibility::Filter(const Function& keep) {
  for (size_t index = 0; index < neighbors_.size(); ++index) {
    std::vector<int>& neighbors = neighbors_[index];
    std::vector<int>& num_shared = num_shared_[index];
    size_t num_kept = 0;
    for (size_t k = 0; k < neighbors.size(); ++k) {
      if (!keep(index, neighbors[k], num_shared[k])) continue;
      neighbors[num_kept] = neighbors[k];
      num_shared[num_kept++] = num_shared[k];
    }
    neighbors.resize(num_kept);
    num_shared.resize(num_kept);
    near_[index] = 0;
    for (const int other : neighbors) {
      const int offset = other - static_cast<int>(index) - 1;
      if (offset >= kNumNear) break;
      near_[index] |= uint64_t{1} << offset;
    }
  }
}

void Covisibility::Cut(int min_num_shared_points) {
  Filter([&](size_t, int, int num_shared) {
    return num_shared >= min_num_shared_points;
  });
}

void Covisibility::CutRedundant(int min_num_shared_points) {
  // Earlier images first, then later ones: sorted.
  std::vector<std::vector<int>> strong(neighbors_.size());
  for (size_t index = 0; index < neighbors_.size(); ++index) {
    for (size_t k = 0; k < neighbors_[index].size(); ++k) {
      if (num_shared_[index][k] < min_num_shared_points) continue;
      strong[index].push_back(neighbors_[index][k]);
      strong[neighbors_[index][k]].push_back(index);
    }
  }
  Filter([&](size_t index, int other, int num_shared) {
    return num_shared >= min_num_shared_points ||
           !Intersect(strong[index], strong[other]);
  });
}

// Where images are numbered one by one, as mostly, the difference of the ids is
// the index; elsewhere the index is smaller.
int Covisibility::IndexOf(image_t image_id) const {
  if (images_.empty() || image_id < images_.front()) return -1;
  const size_t most =
      std::min<size_t>(image_id - images_.front(), images_.size() - 1);
  if (images_[most] == image_id) return static_cast<int>(most);
  const auto found =
      std::lower_bound(images_.begin(), images_.begin() + most, image_id);
  return *found == image_id ? static_cast<int>(found - images_.begin()) : -1;
}

bool Covisibility::SharePoints(int index1, int index2) const {
  if (index1 == index2 || index1 < 0 || index2 < 0) return true;
  const auto [first, last] = std::minmax(index1, index2);
  if (last - first <= kNumNear) {
    return (near_[first] >> (last - first - 1)) & 1;
  }
  const std::vector<int>& neighbors = neighbors_[first];
  return std::binary_search(neighbors.begin(), neighbors.end(), last);
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
