// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "colmap_ext/matching/best_two.h"
#include "colmap_ext/matching/find_candidates.h"
#include "core/types.h"

namespace adasfm {

// COLMAP's rules and defaults (SiftMatchingOptions). Descriptors are vectors of
// length 512, and their distance is the angle between them [rad].
struct DescriptorMatchingOptions {
  // Largest ratio of the distances of the nearest and the second nearest
  // descriptor. At most 1.
  double max_ratio = 0.8;
  double max_distance_rad = 0.7;
};

// Matches two images by their SIFT descriptors (rows of kSiftDimensions bytes).
// Returns the pairs of descriptors that are each other's nearest ones, both by
// the rules above, in order of the first image's keypoints.
// Method: all products (best_two.h). Unlike a search by randomised trees, the
// result depends on the descriptors only and is complete.
// Throws std::invalid_argument for a max_ratio above 1.
std::vector<FeatureMatch> MatchDescriptors(
    const DescriptorMatchingOptions& options, const uint8_t* descriptors1,
    int count1, const uint8_t* descriptors2, int count2,
    ProductKernel kernel = ProductKernel::kAutomatic);

// The same among the candidate pairs only: other descriptors count neither as
// the nearest nor as the second nearest one.
std::vector<FeatureMatch> MatchCandidateDescriptors(
    const DescriptorMatchingOptions& options, const uint8_t* descriptors1,
    int count1, const uint8_t* descriptors2, int count2,
    const MatchCandidates& candidates);

}  // namespace adasfm
