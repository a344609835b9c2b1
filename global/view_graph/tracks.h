// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "core/types.h"

namespace adasfm {

struct TrackElement {
  image_t image_id = kInvalidImageId;
  point2D_t point2D_idx = 0;

  friend bool operator==(const TrackElement& a, const TrackElement& b) {
    return a.image_id == b.image_id && a.point2D_idx == b.point2D_idx;
  }
  friend bool operator<(const TrackElement& a, const TrackElement& b) {
    return std::tie(a.image_id, a.point2D_idx) <
           std::tie(b.image_id, b.point2D_idx);
  }
};

// Sorted by image; every image at most once.
using Track = std::vector<TrackElement>;

// Smallest number of images of a track: two rays meet in many wrong matches, a
// third one tests them.
inline constexpr int kMinNumTrackImages = 3;

// Upper bound of the bytes that BuildTracks takes at its peak, from the number
// of matches alone.
size_t EstimateTrackBytes(
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches);

// Tracks of matched keypoints (union-find), of at least kMinNumTrackImages.
// Where matches would join two keypoints of one image, the later match (pairs
// by number of matches, most first) is left out, so one wrong match does not
// cost the whole track.
std::vector<Track> BuildTracks(
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches);

// Shortens tracks to max_track_length (at least 3) images, spread evenly from
// the first to the last, and keeps those that an image needs, longest first.
std::vector<Track> SelectTracks(int max_track_length,
                                std::vector<Track> tracks);

// The tracks restricted to these images, if kMinNumTrackImages elements remain.
std::vector<Track> RestrictTracks(const std::vector<Track>& tracks,
                                  const std::set<image_t>& images);

}  // namespace adasfm
