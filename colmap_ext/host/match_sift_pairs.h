// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/database.h>
#include <feature/matching.h>

#include <vector>

#include "core/types.h"

namespace adasfm {

// Matches and verifies pairs of images by their SIFT descriptors, as COLMAP's
// SiftFeatureMatcher does: the same rules and defaults, the same rows in the
// tables matches and two_view_geometries. Pairs that have both are left out.
// Method: all descriptors are compared (matching/match_descriptors.h), where
// COLMAP searches by randomised trees; and COLMAP's TwoViewGeometry verifies,
// each pair from the same seed, with the confidence of COLMAP's defaults for
// every geometry that has enough inliers to be accepted. So the result depends
// neither on the threads nor on the order of the pairs.
// Images must have descriptors of kSiftDimensions bytes, or none.
class SiftPairMatcher {
 public:
  // The database and the cache over it must outlive the matcher.
  SiftPairMatcher(int num_threads, colmap::FeatureMatcherCache* cache)
      : num_threads_(num_threads), cache_(cache) {}

  // Throws std::runtime_error for descriptors of another length.
  void Match(const std::vector<ImagePair>& pairs);

 private:
  struct Result {
    colmap::FeatureMatches matches;
    colmap::TwoViewGeometry geometry;
  };
  Result MatchPair(const ImagePair& pair);
  void Verify(const ImagePair& pair, Result* result);

  int num_threads_ = -1;
  colmap::FeatureMatcherCache* cache_ = nullptr;
};

}  // namespace adasfm
