// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/match_descriptors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/random.h"

namespace adasfm {
namespace {

using Bytes = std::vector<uint8_t>;

int Count(const Bytes& descriptors) {
  return descriptors.size() / kSiftDimensions;
}

// Descriptors of few different directions, many of them more than once, with a
// little noise on some: near ones, equal ones and far ones.
Bytes DrawDescriptors(int count, int num_directions, Random* random) {
  Bytes directions(num_directions * kSiftDimensions);
  for (uint8_t& number : directions) {
    number = random->UniformInt(0, 3) == 0 ? random->UniformInt(0, 160) : 0;
  }
  Bytes descriptors;
  for (int i = 0; i < count; ++i) {
    const int direction = random->UniformInt(0, num_directions - 1);
    const int noise = random->UniformInt(0, 2) == 0 ? 0 : 20;
    for (int k = 0; k < kSiftDimensions; ++k) {
      const int number = directions[direction * kSiftDimensions + k] +
                         random->UniformInt(-noise, noise);
      descriptors.push_back(std::clamp(number, 0, 255));
    }
  }
  return descriptors;
}

// COLMAP's rule, read off the whole matrix of products: the first of the
// greatest products, in both directions.
class Oracle {
 public:
  Oracle(const Bytes& descriptors1, const Bytes& descriptors2)
      : count1_(Count(descriptors1)), count2_(Count(descriptors2)) {
    for (int i = 0; i < count1_; ++i) {
      for (int j = 0; j < count2_; ++j) {
        int product = 0;
        for (int k = 0; k < kSiftDimensions; ++k) {
          product += descriptors1[i * kSiftDimensions + k] *
                     descriptors2[j * kSiftDimensions + k];
        }
        products_.push_back(product);
      }
    }
  }

  // Makes all pairs but the candidates as far apart as can be.
  void KeepOnly(const MatchCandidates& candidates) {
    std::vector<int> kept(products_.size(), 0);
    for (int i = 0; i < count1_; ++i) {
      for (int k = candidates.begins[i]; k < candidates.begins[i + 1]; ++k) {
        kept[i * count2_ + candidates.indices[k]] =
            At(i, candidates.indices[k]);
      }
    }
    products_ = kept;
  }

  std::vector<FeatureMatch> Match(const DescriptorMatchingOptions& options) {
    std::vector<FeatureMatch> matches;
    for (int i = 0; i < count1_; ++i) {
      const int j = Nearest(options, count2_, [&](int j) { return At(i, j); });
      if (j < 0) continue;
      const int back =
          Nearest(options, count1_, [&](int k) { return At(k, j); });
      if (back == i) {
        matches.push_back(
            {static_cast<point2D_t>(i), static_cast<point2D_t>(j)});
      }
    }
    return matches;
  }

 private:
  int At(int i, int j) const { return products_[i * count2_ + j]; }

  template <typename Product>
  static int Nearest(const DescriptorMatchingOptions& options, int count,
                     const Product& product) {
    int nearest = -1;
    int best = 0;
    int second = 0;
    for (int i = 0; i < count; ++i) {
      if (product(i) > best) {
        nearest = i;
        second = best;
        best = product(i);
      } else {
        second = std::max(second, product(i));
      }
    }
    if (nearest < 0) return -1;
    constexpr float kNorm = 1.0f / (512.0f * 512.0f);
    const float distance = std::acos(std::min(kNorm * best, 1.0f));
    const float next = std::acos(std::min(kNorm * second, 1.0f));
    if (distance > static_cast<float>(options.max_distance_rad)) return -1;
    return distance >= static_cast<float>(options.max_ratio) * next ? -1
                                                                    : nearest;
  }

  int count1_ = 0;
  int count2_ = 0;
  std::vector<int> products_;
};

std::vector<FeatureMatch> Match(
    const Bytes& descriptors1, const Bytes& descriptors2,
    const DescriptorMatchingOptions& options = {},
    ProductKernel kernel = ProductKernel::kAutomatic) {
  return MatchDescriptors(options, descriptors1.data(), Count(descriptors1),
                          descriptors2.data(), Count(descriptors2), kernel);
}

class MatchDescriptorsTest : public testing::TestWithParam<ProductKernel> {};

TEST_P(MatchDescriptorsTest, EqualsTheDoubleLoop) {
  if (!HasKernel(GetParam())) GTEST_SKIP() << "not on this processor";
  size_t num_matches = 0;
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    Random random(seed);
    // Sizes with full groups, and with groups that are not full.
    for (const auto& [count1, count2] :
         {std::pair(0, 5), {5, 0}, {1, 1}, {7, 40}, {96, 64}, {131, 97}}) {
      const Bytes all = DrawDescriptors(count1 + count2, 90, &random);
      const Bytes first(all.begin(), all.begin() + count1 * kSiftDimensions);
      const Bytes second(all.begin() + count1 * kSiftDimensions, all.end());
      for (const double max_ratio : {0.5, 0.8, 1.0}) {
        const DescriptorMatchingOptions options = {max_ratio, 0.7};
        const std::vector<FeatureMatch> expected =
            Oracle(first, second).Match(options);
        EXPECT_EQ(Match(first, second, options, GetParam()), expected)
            << count1 << " x " << count2 << ", seed " << seed;
        num_matches += expected.size();
      }
    }
  }
  EXPECT_GT(num_matches, 100);
}

// Numbers whose products overflow sums of 16 bits.
TEST_P(MatchDescriptorsTest, GreatestNumbers) {
  if (!HasKernel(GetParam())) GTEST_SKIP() << "not on this processor";
  BestTwo of1;
  BestTwo of2;
  const Bytes first(2 * kSiftDimensions, 255);
  Bytes second(3 * kSiftDimensions, 255);
  second[2 * kSiftDimensions] = 254;
  FindBestTwo(first.data(), 2, second.data(), 3, GetParam(), &of1, &of2);
  const int greatest = kSiftDimensions * 255 * 255;
  EXPECT_EQ(of1.best, (std::vector<int32_t>{greatest, greatest}));
  EXPECT_EQ(of1.second, of1.best);
  EXPECT_EQ(of2.best,
            (std::vector<int32_t>{greatest, greatest, greatest - 255}));
  EXPECT_EQ(of2.second, of2.best);
}

INSTANTIATE_TEST_SUITE_P(Kernels, MatchDescriptorsTest,
                         testing::Values(ProductKernel::kAutomatic,
                                         ProductKernel::kPortable,
                                         ProductKernel::kAvx2,
                                         ProductKernel::kAvx512Vnni));

TEST(MatchCandidateDescriptors, EqualsTheDoubleLoopOverTheCandidates) {
  constexpr int kCount1 = 80;
  constexpr int kCount2 = 60;
  size_t num_matches = 0;
  size_t num_without_candidates = 0;
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    // Hardly any descriptor occurs twice, so that few candidates have equal
    // products.
    const Bytes all = DrawDescriptors(kCount1 + kCount2, 90, &random);
    const Bytes first(all.begin(), all.begin() + kCount1 * kSiftDimensions);
    const Bytes second(all.begin() + kCount1 * kSiftDimensions, all.end());
    for (const int chance : {1, 3, 20}) {
      MatchCandidates candidates;
      candidates.begins.push_back(0);
      for (int i = 0; i < kCount1; ++i) {
        for (int k = 0; k < kCount2; ++k) {
          if (random.UniformInt(1, chance) == 1) {
            candidates.indices.push_back(k);
          }
        }
        candidates.begins.push_back(candidates.indices.size());
      }
      Oracle oracle(first, second);
      num_without_candidates += oracle.Match({}).size();
      oracle.KeepOnly(candidates);
      const std::vector<FeatureMatch> matches = MatchCandidateDescriptors(
          {}, first.data(), kCount1, second.data(), kCount2, candidates);
      EXPECT_EQ(matches, oracle.Match({})) << "seed " << seed;
      num_matches += matches.size();
    }
  }
  EXPECT_GT(num_matches, 30);
  EXPECT_NE(num_matches, num_without_candidates);
}

TEST(MatchDescriptors, EveryOptionCounts) {
  Random random(7);
  const Bytes first = DrawDescriptors(100, 90, &random);
  random = Random(7);
  const Bytes second = DrawDescriptors(120, 90, &random);
  const size_t num_matches = Match(first, second).size();
  EXPECT_GT(num_matches, 0);
  EXPECT_LT(Match(first, second, {0.2, 0.7}).size(), num_matches);
  EXPECT_LT(Match(first, second, {0.8, 0.1}).size(), num_matches);
  EXPECT_THROW(Match(first, second, {1.1, 0.7}), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
