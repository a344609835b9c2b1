// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/tracks.h"

#include <algorithm>
#include <utility>

#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

using Matches = std::map<ImagePair, std::vector<FeatureMatch>>;

// The keypoints that have matches, numbered in order of (image, keypoint).
class MatchedKeypoints {
 public:
  explicit MatchedKeypoints(const Matches& matches) {
    for (const auto& [pair, pair_matches] : matches) {
      Image& image1 = images_[pair.image_id1];
      Image& image2 = images_[pair.image_id2];
      for (const FeatureMatch& match : pair_matches) {
        Mark(match.point2D_idx1, &image1);
        Mark(match.point2D_idx2, &image2);
      }
    }
    for (auto& [image_id, image] : images_) {
      for (point2D_t idx = 0; idx < image.number_of.size(); ++idx) {
        if (image.number_of[idx] == kUnmatched) continue;
        image.number_of[idx] = static_cast<int>(keypoints_.size());
        keypoints_.push_back({image_id, idx});
      }
    }
  }

  size_t size() const { return keypoints_.size(); }
  const TrackElement& operator[](size_t k) const { return keypoints_[k]; }
  // Numbers of an image's keypoints, by index.
  const std::vector<int>& NumbersOf(image_t image_id) const {
    return images_.at(image_id).number_of;
  }

 private:
  static constexpr int kUnmatched = -1;
  struct Image {
    std::vector<int> number_of;
  };

  static void Mark(point2D_t idx, Image* image) {
    if (idx >= image->number_of.size()) {
      image->number_of.resize(idx + 1, kUnmatched);
    }
    image->number_of[idx] = 0;
  }

  std::map<image_t, Image> images_;
  std::vector<TrackElement> keypoints_;
};

// Union-find that stores the images of each set, so that no set contains two
// keypoints of one image.
class KeypointSets {
 public:
  explicit KeypointSets(const MatchedKeypoints& keypoints)
      : keypoints_(keypoints),
        sets_(keypoints.size()),
        images_(keypoints.size()) {}

  void JoinIfConsistent(int a, int b) {
    a = sets_.Find(a);
    b = sets_.Find(b);
    if (a == b) return;
    if (images_[a].empty()) images_[a] = {keypoints_[a].image_id};
    if (images_[b].empty()) images_[b] = {keypoints_[b].image_id};
    if (ShareImage(images_[a], images_[b])) return;
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
  std::vector<Track> Collect(size_t min_length) {
    std::vector<int> track_of(keypoints_.size(), -1);
    std::vector<Track> tracks;
    for (size_t k = 0; k < keypoints_.size(); ++k) {
      const int root = sets_.Find(k);
      const size_t length = std::max<size_t>(1, images_[root].size());
      if (length < min_length) continue;
      if (track_of[root] < 0) {
        track_of[root] = tracks.size();
        tracks.emplace_back().reserve(length);
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

  const MatchedKeypoints& keypoints_;
  DisjointSets sets_;
  // Sorted; of roots. Empty for a keypoint that no match has met yet.
  std::vector<std::vector<image_t>> images_;
};

// The first, the last, and evenly spread elements between them. The phase
// differs from track to track, so that no image is always left out.
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
std::vector<Track> SelectNeededTracks(std::vector<Track> tracks) {
  // Tracks that an image needs.
  constexpr int kMinNumTracksPerImage = 120;
  std::stable_sort(
      tracks.begin(), tracks.end(),
      [](const Track& a, const Track& b) { return a.size() > b.size(); });
  std::map<image_t, int> num_tracks;
  std::vector<Track> selected;
  for (Track& track : tracks) {
    const bool is_needed = std::any_of(
        track.begin(), track.end(), [&](const TrackElement& element) {
          return num_tracks[element.image_id] < kMinNumTracksPerImage;
        });
    if (!is_needed) continue;
    for (const TrackElement& element : track) ++num_tracks[element.image_id];
    selected.push_back(std::move(track));
  }
  return selected;
}

}  // namespace

size_t EstimateTrackBytes(const Matches& matches) {
  // malloc rounds up to 32 bytes a block.
  constexpr size_t kBlock = 32;
  size_t num_keypoints = 0;
  size_t num_indices = 0;
  std::map<image_t, std::pair<size_t, size_t>> images;  // ends, indices
  for (const auto& [pair, pair_matches] : matches) {
    auto& [num_ends1, num_indices1] = images[pair.image_id1];
    auto& [num_ends2, num_indices2] = images[pair.image_id2];
    num_ends1 += pair_matches.size();
    num_ends2 += pair_matches.size();
    for (const FeatureMatch& match : pair_matches) {
      num_indices1 = std::max<size_t>(num_indices1, match.point2D_idx1 + 1);
      num_indices2 = std::max<size_t>(num_indices2, match.point2D_idx2 + 1);
    }
  }
  for (const auto& [image_id, counts] : images) {
    num_keypoints += std::min(counts.first, counts.second);
    num_indices += counts.second;
  }
  // Vectors grow by doubling, while old and new memory coexist.
  const size_t numbering =
      3 * (num_indices * sizeof(int) + num_keypoints * sizeof(TrackElement));
  const size_t per_keypoint =
      sizeof(int) +                                       // parent
      sizeof(std::vector<image_t>) + kBlock +             // its set
      sizeof(int) +                                       // track of the set
      sizeof(Track) + kBlock + 2 * sizeof(TrackElement);  // the track
  return numbering + num_keypoints * per_keypoint;
}

std::vector<Track> BuildTracks(const Matches& matches) {
  const MatchedKeypoints keypoints(matches);
  KeypointSets sets(keypoints);
  std::vector<const Matches::value_type*> pairs;
  for (const auto& pair : matches) pairs.push_back(&pair);
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const auto* a, const auto* b) {
                     return a->second.size() > b->second.size();
                   });
  for (const auto* pair : pairs) {
    const std::vector<int>& numbers1 =
        keypoints.NumbersOf(pair->first.image_id1);
    const std::vector<int>& numbers2 =
        keypoints.NumbersOf(pair->first.image_id2);
    for (const FeatureMatch& match : pair->second) {
      sets.JoinIfConsistent(numbers1[match.point2D_idx1],
                            numbers2[match.point2D_idx2]);
    }
  }
  return sets.Collect(kMinNumTrackImages);
}

std::vector<Track> SelectTracks(int max_track_length,
                                std::vector<Track> tracks) {
  for (Track& track : tracks) track = Shorten(track, max_track_length);
  return SelectNeededTracks(std::move(tracks));
}

std::vector<Track> RestrictTracks(const std::vector<Track>& tracks,
                                  const std::set<image_t>& images) {
  std::vector<Track> restricted;
  for (const Track& track : tracks) {
    Track rest;
    for (const TrackElement& element : track) {
      if (images.count(element.image_id)) rest.push_back(element);
    }
    if (rest.size() >= static_cast<size_t>(kMinNumTrackImages)) {
      restricted.push_back(std::move(rest));
    }
  }
  return restricted;
}

}  // namespace adasfm
