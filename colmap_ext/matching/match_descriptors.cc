// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/match_descriptors.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace adasfm {
namespace {

// Single precision, as in COLMAP.
float Distance(int32_t product) {
  constexpr float kSquaredLength = 512.0f * 512.0f;
  return std::acos(
      std::min(1.0f / kSquaredLength * static_cast<float>(product), 1.0f));
}

bool IsNear(const DescriptorMatchingOptions& options, int32_t best,
            int32_t second) {
  if (best <= 0) return false;
  const float distance = Distance(best);
  return distance <= static_cast<float>(options.max_distance_rad) &&
         distance < static_cast<float>(options.max_ratio) * Distance(second);
}

int32_t Product(const uint8_t* a, const uint8_t* b) {
  int32_t product = 0;
  for (int k = 0; k < kSiftDimensions; ++k) product += a[k] * b[k];
  return product;
}

// The greatest products, with the descriptors' indices, of descriptors whose
// nearest one is near enough; sorted.
std::vector<std::pair<int32_t, int>> NearOnes(
    const DescriptorMatchingOptions& options, const BestTwo& best_two) {
  std::vector<std::pair<int32_t, int>> near;
  for (size_t i = 0; i < best_two.best.size(); ++i) {
    if (IsNear(options, best_two.best[i], best_two.second[i])) {
      near.emplace_back(best_two.best[i], i);
    }
  }
  std::sort(near.begin(), near.end());
  return near;
}

void CheckOptions(const DescriptorMatchingOptions& options) {
  if (!(options.max_ratio <= 1.0)) {
    throw std::invalid_argument("MatchDescriptors: max_ratio is above 1");
  }
}

// Two descriptors are each other's nearest ones if their product is the
// greatest of both. Each nearest one is strictly nearer than the second, so
// there is only one such partner.
std::vector<FeatureMatch> MatchNearest(const DescriptorMatchingOptions& options,
                                       const BestTwo& of1, const BestTwo& of2,
                                       const uint8_t* descriptors1,
                                       const uint8_t* descriptors2) {
  const std::vector<std::pair<int32_t, int>> near2 = NearOnes(options, of2);
  std::vector<FeatureMatch> matches;
  for (const auto& [product, i1] : NearOnes(options, of1)) {
    auto partner = std::lower_bound(near2.begin(), near2.end(),
                                    std::make_pair(product, 0));
    for (; partner != near2.end() && partner->first == product; ++partner) {
      const int i2 = partner->second;
      if (Product(descriptors1 + i1 * kSiftDimensions,
                  descriptors2 + i2 * kSiftDimensions) == product) {
        matches.push_back(
            {static_cast<point2D_t>(i1), static_cast<point2D_t>(i2)});
        break;
      }
    }
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

void Insert(int32_t product, int i, BestTwo* best_two) {
  int32_t& best = best_two->best[i];
  int32_t& second = best_two->second[i];
  second = std::max(second, std::min(best, product));
  best = std::max(best, product);
}

// One instruction multiplies eight numbers of this type.
std::vector<int16_t> Widen(const uint8_t* descriptors, int count) {
  return std::vector<int16_t>(descriptors,
                              descriptors + count * kSiftDimensions);
}

int32_t Product(const int16_t* a, const int16_t* b) {
  int32_t product = 0;
  for (int k = 0; k < kSiftDimensions; ++k) product += a[k] * b[k];
  return product;
}

}  // namespace

std::vector<FeatureMatch> MatchDescriptors(
    const DescriptorMatchingOptions& options, const uint8_t* descriptors1,
    int count1, const uint8_t* descriptors2, int count2, ProductKernel kernel) {
  CheckOptions(options);
  BestTwo of1;
  BestTwo of2;
  FindBestTwo(descriptors1, count1, descriptors2, count2, kernel, &of1, &of2);
  return MatchNearest(options, of1, of2, descriptors1, descriptors2);
}

std::vector<FeatureMatch> MatchCandidateDescriptors(
    const DescriptorMatchingOptions& options, const uint8_t* descriptors1,
    int count1, const uint8_t* descriptors2, int count2,
    const MatchCandidates& candidates) {
  CheckOptions(options);
  const std::vector<int16_t> wide1 = Widen(descriptors1, count1);
  const std::vector<int16_t> wide2 = Widen(descriptors2, count2);
  BestTwo of1{std::vector<int32_t>(count1), std::vector<int32_t>(count1)};
  BestTwo of2{std::vector<int32_t>(count2), std::vector<int32_t>(count2)};
  for (int i1 = 0; i1 < count1; ++i1) {
    for (int k = candidates.begins[i1]; k < candidates.begins[i1 + 1]; ++k) {
      const int i2 = candidates.indices[k];
      const int32_t product = Product(wide1.data() + i1 * kSiftDimensions,
                                      wide2.data() + i2 * kSiftDimensions);
      Insert(product, i1, &of1);
      Insert(product, i2, &of2);
    }
  }
  return MatchNearest(options, of1, of2, descriptors1, descriptors2);
}

}  // namespace adasfm
