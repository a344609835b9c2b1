// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/tracks.h"

#include <algorithm>
#include <utility>

#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// Union-find whose sets know their images, so that no set holds two keypoints
// of one image.
class KeypointSets {
 public:
  explicit KeypointSets(std::vector<TrackElement> keypoints)
      : keypoints_(std::move(keypoints)),
        sets_(keypoints_.size()),
        images_(keypoints_.size()) {
    for (size_t k = 0; k < keypoints_.size(); ++k) {
      images_[k] = {keypoints_[k].image_id};
    }
  }

  int IndexOf(const TrackElement& keypoint) const {
    return std::lower_bound(keypoints_.begin(), keypoints_.end(), keypoint) -
           keypoints_.begin();
  }

  void JoinIfConsistent(int a, int b) {
    a = sets_.Find(a);
    b = sets_.Find(b);
    if (a == b || ShareImage(images_[a], images_[b])) return;
    if (images_[a].size() < images_[b].size()) std::swap(a, b);
    sets_.Join(b, a);
    std::vector<image_t> merged;
    merged.reserve(images_[a].size() + images_[b].size());
    std::merge(images_[a].begin(), images_[a].end(), images_[b].begin(),
               images_[b].end(), std::back_inserter(merged));
    images_[a] = std::move(merged);
    images_[b] = {};
  }

  // Sets of at least min_length, in order of their first keypoint.
  std::vector<Track> Collect(int min_length) {
    std::vector<int> track_of(keypoints_.size(), -1);
    std::vector<Track> tracks;
    for (size_t k = 0; k < keypoints_.size(); ++k) {
      const int root = sets_.Find(k);
      if (images_[root].size() < min_length) continue;
      if (track_of[root] < 0) {
        track_of[root] = tracks.size();
        tracks.emplace_back();
      }
      tracks[track_of[root]].push_back(keypoints_[k]);
    }
    return tracks;
  }

 private:
  static bool ShareImage(const std::vector<image_t>& a,
                         const std::vector<image_t>& b) {
    auto i = a.begin();
    auto j = b.begin();
    while (i != a.end() && j != b.end()) {
      if (*i == *j) return true;
      if (*i < *j) {
        ++i;
      } else {
        ++j;
      }
    }
    return false;
  }

  std::vector<TrackElement> keypoints_;  // sorted
  DisjointSets sets_;
  std::vector<std::vector<image_t>> images_;  // sorted; of roots
};

std::vector<TrackElement> CollectKeypoints(
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches) {
  std::vector<TrackElement> keypoints;
  for (const auto& [pair, pair_matches] : matches) {
    for (const FeatureMatch& match : pair_matches) {
      keypoints.push_back({pair.image_id1, match.point2D_idx1});
      keypoints.push_back({pair.image_id2, match.point2D_idx2});
    }
  }
  std::sort(keypoints.begin(), keypoints.end());
  keypoints.erase(std::unique(keypoints.begin(), keypoints.end()),
                  keypoints.end());
  return keypoints;
}

// The first, the last, and evenly spread ones between them, which differ from
// track to track so that no image always falls out.
Track Shorten(const Track& track, size_t max_length) {
  if (track.size() <= max_length) return track;
  constexpr int kNumPhases = 16;
  const double phase =
      static_cast<double>(track.front().point2D_idx % kNumPhases) / kNumPhases;
  const double stride =
      static_cast<double>(track.size() - 2) / (max_length - 2);
  Track shortened = {track.front()};
  for (size_t k = 0; k + 2 < max_length; ++k) {
    shortened.push_back(track[1 + static_cast<size_t>((k + phase) * stride)]);
  }
  shortened.push_back(track.back());
  return shortened;
}

// Longest first; a track is kept while one of its images still needs it.
std::vector<Track> SelectNeededTracks(const TrackOptions& options,
                                      std::vector<Track> tracks) {
  std::stable_sort(
      tracks.begin(), tracks.end(),
      [](const Track& a, const Track& b) { return a.size() > b.size(); });
  std::map<image_t, int> num_tracks;
  std::vector<Track> selected;
  for (Track& track : tracks) {
    const bool is_needed = std::any_of(
        track.begin(), track.end(), [&](const TrackElement& element) {
          return num_tracks[element.image_id] <
                 options.min_num_tracks_per_image;
        });
    if (!is_needed) continue;
    for (const TrackElement& element : track) ++num_tracks[element.image_id];
    selected.push_back(std::move(track));
  }
  return selected;
}

}  // namespace

bool TrackOptions::IsValid(std::string* error) const {
  if (min_track_length < 2) {
    *error = "min_track_length = " + std::to_string(min_track_length) +
             " must be >= 2";
    return false;
  }
  if (max_track_length < std::max(3, min_track_length)) {
    *error = "max_track_length = " + std::to_string(max_track_length) +
             " must be >= 3 and >= min_track_length";
    return false;
  }
  if (min_num_tracks_per_image < 1) {
    *error = "min_num_tracks_per_image = " +
             std::to_string(min_num_tracks_per_image) + " must be >= 1";
    return false;
  }
  return true;
}

size_t EstimateTrackBytes(
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches) {
  // malloc rounds up to 32 bytes a block.
  constexpr size_t kBlock = 32;
  size_t num_matches = 0;
  for (const auto& [pair, pair_matches] : matches) {
    num_matches += pair_matches.size();
  }
  // Both ends of every match are listed; vectors grow by doubling, while old
  // and new are there.
  const size_t num_keypoints = 2 * num_matches;
  const size_t listing = 3 * num_keypoints * sizeof(TrackElement);
  const size_t per_keypoint =
      sizeof(TrackElement) + sizeof(int) +                // keypoint, parent
      sizeof(std::vector<image_t>) + kBlock +             // its set
      sizeof(int) +                                       // track of the set
      sizeof(Track) + kBlock + 2 * sizeof(TrackElement);  // the track
  return listing + num_keypoints * per_keypoint;
}

std::vector<Track> JoinMatches(
    const TrackOptions& options,
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches) {
  KeypointSets sets(CollectKeypoints(matches));
  std::vector<const std::pair<const ImagePair, std::vector<FeatureMatch>>*>
      pairs;
  for (const auto& pair : matches) pairs.push_back(&pair);
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const auto* a, const auto* b) {
                     return a->second.size() > b->second.size();
                   });
  for (const auto* pair : pairs) {
    for (const FeatureMatch& match : pair->second) {
      sets.JoinIfConsistent(
          sets.IndexOf({pair->first.image_id1, match.point2D_idx1}),
          sets.IndexOf({pair->first.image_id2, match.point2D_idx2}));
    }
  }
  return sets.Collect(options.min_track_length);
}

std::vector<Track> SelectTracks(const TrackOptions& options,
                                std::vector<Track> tracks) {
  for (Track& track : tracks) {
    track = Shorten(track, options.max_track_length);
  }
  return SelectNeededTracks(options, std::move(tracks));
}

std::vector<Track> RestrictTracks(const TrackOptions& options,
                                  const std::vector<Track>& tracks,
                                  const std::set<image_t>& images) {
  std::vector<Track> restricted;
  for (const Track& track : tracks) {
    Track rest;
    for (const TrackElement& element : track) {
      if (images.count(element.image_id)) rest.push_back(element);
    }
    if (rest.size() >= static_cast<size_t>(options.min_track_length)) {
      restricted.push_back(std::move(rest));
    }
  }
  return restricted;
}

}  // namespace adasfm
