// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/select_keyframes.h"

#include <algorithm>
#include <map>

namespace adasfm {
namespace {

// An image is passed over only if the last keyframe and the next image have
// this many tracks in common.
constexpr int kMinNumSharedTracks = 40;

// The images one after the other, as far as complete priors tie them.
class Chain {
 public:
  Chain(const std::set<image_t>& images,
        const std::vector<RelativePosePrior>& priors) {
    for (const RelativePosePrior& prior : priors) {
      if (!prior.HasRotation() || !prior.HasDirection() || !prior.HasLength() ||
          images.count(prior.image_id1) == 0 ||
          images.count(prior.image_id2) == 0 ||
          next_.count(prior.image_id1) > 0 ||
          previous_.count(prior.image_id2) > 0) {
        continue;
      }
      next_[prior.image_id1] = prior.image_id2;
      previous_[prior.image_id2] = prior.image_id1;
    }
  }

  bool HasPrevious(image_t image_id) const {
    return previous_.count(image_id) > 0;
  }
  // kInvalidImageId at the end.
  image_t Next(image_t image_id) const {
    const auto it = next_.find(image_id);
    return it == next_.end() ? kInvalidImageId : it->second;
  }

 private:
  std::map<image_t, image_t> next_;
  std::map<image_t, image_t> previous_;
};

class SharedTracks {
 public:
  explicit SharedTracks(const std::vector<Track>& tracks) {
    for (size_t i = 0; i < tracks.size(); ++i) {
      for (const TrackElement& element : tracks[i]) {
        tracks_of_[element.image_id].push_back(i);
      }
    }
  }

  int Count(image_t image_id1, image_t image_id2) const {
    const auto it1 = tracks_of_.find(image_id1);
    const auto it2 = tracks_of_.find(image_id2);
    if (it1 == tracks_of_.end() || it2 == tracks_of_.end()) return 0;
    std::vector<size_t> shared;
    std::set_intersection(it1->second.begin(), it1->second.end(),
                          it2->second.begin(), it2->second.end(),
                          std::back_inserter(shared));
    return static_cast<int>(shared.size());
  }

 private:
  std::map<image_t, std::vector<size_t>> tracks_of_;  // sorted
};

}  // namespace

std::set<image_t> SelectKeyframes(const std::set<image_t>& images,
                                  const std::vector<Track>& tracks,
                                  const std::vector<RelativePosePrior>& priors,
                                  size_t min_num_images) {
  if (images.size() < min_num_images) return images;
  const Chain chain(images, priors);
  const SharedTracks shared(tracks);
  // Starts with all images: a ring of priors has no first image and stays as it
  // is.
  std::set<image_t> keyframes = images;
  for (const image_t first : images) {
    if (chain.HasPrevious(first)) continue;
    image_t last_keyframe = first;
    int num_passed_over = 0;
    for (image_t id = first; id != kInvalidImageId; id = chain.Next(id)) {
      const image_t next = chain.Next(id);
      const bool is_passed_over =
          id != first && next != kInvalidImageId &&
          num_passed_over + 1 < kKeyframeStride &&
          shared.Count(last_keyframe, next) >= kMinNumSharedTracks;
      if (is_passed_over) {
        keyframes.erase(id);
        ++num_passed_over;
      } else {
        last_keyframe = id;
        num_passed_over = 0;
      }
    }
  }
  return keyframes;
}

}  // namespace adasfm
