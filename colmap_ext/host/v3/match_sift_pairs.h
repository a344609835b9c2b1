// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/database.h>
#include <feature/matching.h>

#include <optional>
#include <utility>
#include <vector>

#include "colmap_ext/matching/motion_prediction.h"
#include "core/types.h"

namespace adasfm {

// Matches and verifies pairs of images by their SIFT descriptors, as COLMAP's
// SiftFeatureMatcher does: the same rules and defaults, and the same rows in
// the tables matches and two_view_geometries. Pairs that have both rows are
// skipped.
// Method: all descriptors are compared (matching/match_descriptors.h), where
// COLMAP searches by randomised trees. COLMAP's TwoViewGeometry verifies, each
// pair from the same seed, with the confidence of COLMAP's defaults for every
// geometry that has enough inliers to be accepted. So the result depends
// neither on the threads nor on the order of the pairs.
// Where the motion between the images is predicted, only keypoints that can
// show the same point under this motion are compared
// (matching/find_candidates.h), and the geometry is searched near the
// prediction (verify_prediction.h). When this search finds no geometry, or when
// a sample of matches found without the prediction does not confirm it, the
// pair is matched like any other. Images must have descriptors of
// kSiftDimensions bytes, or none.
class SiftPairMatcher {
 public:
  // The database and the cache over it must outlive the matcher.
  SiftPairMatcher(int num_threads, colmap::FeatureMatcherCache* cache,
                  MotionPredictor predictor = {})
      : num_threads_(num_threads),
        cache_(cache),
        predictor_(std::move(predictor)) {}

  // Throws std::runtime_error for descriptors of another length.
  void Match(const std::vector<ImagePair>& pairs);

  // Number of pairs matched by Match whose geometry is the predicted one.
  int NumGuided() const { return num_guided_; }

 private:
  struct Result {
    colmap::FeatureMatches matches;
    colmap::TwoViewGeometry geometry;
    bool is_guided = false;
  };
  Result MatchPair(const ImagePair& pair);
  std::optional<Result> MatchByPrediction(const ImagePair& pair);
  void Verify(const ImagePair& pair, Result* result);

  int num_threads_ = -1;
  colmap::FeatureMatcherCache* cache_ = nullptr;
  MotionPredictor predictor_;
  int num_guided_ = 0;
};

}  // namespace adasfm
