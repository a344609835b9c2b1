// SPDX-License-Identifier: BSD-3-Clause
#include "core/random.h"

#include <gtest/gtest.h>

#include <set>

namespace adasfm {
namespace {

TEST(Random, EqualSeedsGiveEqualDraws) {
  Random a(7);
  Random b(7);
  Random other(8);
  bool differs = false;
  for (int i = 0; i < 100; ++i) {
    const double draw = a.Gaussian(1.0);
    EXPECT_EQ(draw, b.Gaussian(1.0));
    differs |= draw != other.Gaussian(1.0);
  }
  EXPECT_TRUE(differs);
}

TEST(Random, GaussianHasItsMoments) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    const int count = 100000;
    double sum = 0.0;
    double sum2 = 0.0;
    for (int i = 0; i < count; ++i) {
      const double draw = random.Gaussian(2.0);
      sum += draw;
      sum2 += draw * draw;
    }
    // Five standard errors: of the mean sigma / sqrt(n), of the variance
    // sigma^2 sqrt(2 / n).
    EXPECT_NEAR(sum / count, 0.0, 5.0 * 2.0 / std::sqrt(count));
    EXPECT_NEAR(sum2 / count, 4.0, 5.0 * 4.0 * std::sqrt(2.0 / count));
  }
}

TEST(Random, SampleDrawsDifferentValues) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const std::vector<int> sample = random.Sample(5, 8);
    EXPECT_EQ(std::set<int>(sample.begin(), sample.end()).size(), 5u);
    for (const int value : sample) {
      EXPECT_GE(value, 0);
      EXPECT_LT(value, 8);
    }
  }
  EXPECT_THROW(random.Sample(3, 2), std::invalid_argument);
}

TEST(Random, UniformIntReachesItsEnds) {
  Random random(4);
  std::set<int64_t> seen;
  for (int i = 0; i < 200; ++i) seen.insert(random.UniformInt(-1, 2));
  EXPECT_EQ(seen, (std::set<int64_t>{-1, 0, 1, 2}));
}

}  // namespace
}  // namespace adasfm
