// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/untied_parts.h"

#include <algorithm>
#include <map>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// Seven degrees of freedom, with a margin for wrong points.
constexpr int kMinNumCommonPoints = 6;
// The number of matches of a verified pair.
constexpr int kMinNumOwnPoints = 15;

class ImageGroups {
 public:
  ImageGroups(const std::vector<RelativePosePrior>& priors,
              const colmap::Reconstruction& reconstruction)
      : images_(RegisteredImages(reconstruction)), sets_(images_.size()) {
    for (const image_t image_id : images_) {
      index_.emplace(image_id, static_cast<int>(index_.size()));
    }
    for (const RelativePosePrior& prior : priors) {
      const auto first = index_.find(prior.image_id1);
      const auto second = index_.find(prior.image_id2);
      if (prior.HasMotion() && first != index_.end() &&
          second != index_.end()) {
        sets_.Join(first->second, second->second);
      }
    }
    ReadTracks(reconstruction);
  }

  void TieByPoints() {
    std::map<std::pair<int, int>, int> common;
    for (const std::vector<int>& track : tracks_) {
      for (size_t k = 1; k < track.size(); ++k) {
        ++common[{track[k - 1], track[k]}];
      }
    }
    Join(common);
    // Larger groups may share enough points with others.
    do {
      common.clear();
      for (const std::vector<int>& track : tracks_) {
        std::set<int> groups;
        for (const int i : track) groups.insert(sets_.Find(i));
        for (auto a = groups.begin(); a != groups.end(); ++a) {
          for (auto b = std::next(a); b != groups.end(); ++b) {
            ++common[{*a, *b}];
          }
        }
      }
    } while (Join(common));
  }

  std::vector<std::set<image_t>> Parts() {
    std::map<int, std::set<image_t>> images_of;
    std::map<int, int> num_points_of;
    for (const auto& [image_id, i] : index_) {
      images_of[sets_.Find(i)].insert(image_id);
    }
    for (const std::vector<int>& track : tracks_) {
      std::set<int> groups;
      for (const int i : track) groups.insert(sets_.Find(i));
      for (const int group : groups) ++num_points_of[group];
    }
    std::vector<std::set<image_t>> parts;
    for (auto& [group, images] : images_of) {
      if (num_points_of[group] >= kMinNumOwnPoints) {
        parts.push_back(std::move(images));
      }
    }
    std::stable_sort(
        parts.begin(), parts.end(),
        [](const auto& a, const auto& b) { return a.size() > b.size(); });
    if (!parts.empty()) parts.erase(parts.begin());
    return parts;
  }

 private:
  void ReadTracks(const colmap::Reconstruction& reconstruction) {
    for (const auto& [point_id, point] : reconstruction.Points3D()) {
      std::set<int> images;
      for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
        const auto found = index_.find(element.image_id);
        if (found != index_.end()) images.insert(found->second);
      }
      tracks_.emplace_back(images.begin(), images.end());
    }
  }

  bool Join(const std::map<std::pair<int, int>, int>& common) {
    bool any = false;
    for (const auto& [pair, count] : common) {
      if (count < kMinNumCommonPoints ||
          sets_.Find(pair.first) == sets_.Find(pair.second)) {
        continue;
      }
      sets_.Join(pair.first, pair.second);
      any = true;
    }
    return any;
  }

  const std::set<image_t> images_;
  std::map<image_t, int> index_;
  DisjointSets sets_;
  // For each point the indices of its images, ascending.
  std::vector<std::vector<int>> tracks_;
};

}  // namespace

std::vector<std::set<image_t>> FindUntiedParts(
    const std::vector<RelativePosePrior>& priors,
    const colmap::Reconstruction& reconstruction) {
  ImageGroups groups(priors, reconstruction);
  groups.TieByPoints();
  return groups.Parts();
}

}  // namespace adasfm
