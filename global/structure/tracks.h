// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <string>
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

struct TrackOptions {
  int min_track_length = 3;
  // Longer tracks keep this many images, spread evenly from the first to the
  // last: the adjustment's cost grows with the square of a track's length, and
  // many short tracks constrain an image as well as few long ones.
  int max_track_length = 12;
  // Tracks are selected, longest first, while one of their images has fewer
  // tracks than this.
  int min_num_tracks_per_image = 120;

  bool IsValid(std::string* error) const;
};

// Upper bound of the bytes that BuildTracks takes at its peak, from the number
// of matches alone.
size_t EstimateTrackBytes(
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches);

// Tracks of matched keypoints (union-find), of at least min_track_length. Where
// matches would join two keypoints of one image, the later match (pairs by
// number of matches, most first) is left out, so one wrong match does not cost
// the whole track.
std::vector<Track> BuildTracks(
    const TrackOptions& options,
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches);

// Shortens the tracks and keeps those that an image needs, by the options.
std::vector<Track> SelectTracks(const TrackOptions& options,
                                std::vector<Track> tracks);

// The tracks restricted to these images, if min_track_length elements remain.
std::vector<Track> RestrictTracks(const TrackOptions& options,
                                  const std::vector<Track>& tracks,
                                  const std::set<image_t>& images);

}  // namespace adasfm
