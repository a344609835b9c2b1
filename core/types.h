// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>
#include <utility>

namespace adasfm {

// The same widths as COLMAP's, so that ids pass between the layers unchanged.
using image_t = uint32_t;
using camera_t = uint32_t;
using point2D_t = uint32_t;

inline constexpr image_t kInvalidImageId = std::numeric_limits<image_t>::max();

// Time in nanoseconds.
using timestamp_t = int64_t;

inline double SecondsFromNs(timestamp_t time_ns) { return 1e-9 * time_ns; }
inline timestamp_t NsFromSeconds(double time_s) {
  return std::llround(1e9 * time_s);
}

// An unordered image pair, stored with the smaller id first.
struct ImagePair {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;

  ImagePair() = default;
  ImagePair(image_t a, image_t b)
      : image_id1(a < b ? a : b), image_id2(a < b ? b : a) {}

  friend bool operator<(const ImagePair& a, const ImagePair& b) {
    return std::tie(a.image_id1, a.image_id2) <
           std::tie(b.image_id1, b.image_id2);
  }
  friend bool operator==(const ImagePair& a, const ImagePair& b) {
    return a.image_id1 == b.image_id1 && a.image_id2 == b.image_id2;
  }
};

// Keypoint indices of one match: (in image 1, in image 2).
struct FeatureMatch {
  point2D_t point2D_idx1 = 0;
  point2D_t point2D_idx2 = 0;

  friend bool operator==(const FeatureMatch& a, const FeatureMatch& b) {
    return a.point2D_idx1 == b.point2D_idx1 && a.point2D_idx2 == b.point2D_idx2;
  }
  friend bool operator<(const FeatureMatch& a, const FeatureMatch& b) {
    return std::tie(a.point2D_idx1, a.point2D_idx2) <
           std::tie(b.point2D_idx1, b.point2D_idx2);
  }
};

}  // namespace adasfm
