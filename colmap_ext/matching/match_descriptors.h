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
  // The nearest descriptor must be nearer than this share of the distance of
  // the second nearest one. At most 1.
  double max_ratio = 0.8;
  double max_distance_rad = 0.7;
};

// The matches of two images by their SIFT descriptors (rows of kSiftDimensions
// bytes): pairs of descriptors that are each other's nearest ones, both by the
// rules above; in order of the first image's keypoints.
// Method: all products (best_two.h). Unlike search by randomised trees, what
// comes out depends on nothing but the descriptors, and misses nothing.
// Throws std::invalid_argument for a max_ratio above 1.
std::vector<FeatureMatch> MatchDescriptors(
    const DescriptorMatchingOptions& options, const uint8_t* descriptors1,
    int count1, const uint8_t* descriptors2, int count2,
    ProductKernel kernel = ProductKernel::kAutomatic);

// The same, of no other pairs of descriptors than the candidates: what is no
// candidate counts neither as the nearest nor as the second nearest one.
std::vector<FeatureMatch> MatchCandidateDescriptors(
    const DescriptorMatchingOptions& options, const uint8_t* descriptors1,
    int count1, const uint8_t* descriptors2, int count2,
    const MatchCandidates& candidates);

}  // namespace adasfm
