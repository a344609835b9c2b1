// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/consistent_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/random.h"

namespace adasfm {
namespace {

bool IsClique(const ConsistencyMatrix& matrix, const std::vector<int>& set) {
  for (const int a : set) {
    for (const int b : set) {
      if (a != b && !matrix[a][b]) return false;
    }
  }
  return true;
}

int Weigh(const std::vector<int>& weights, const std::vector<int>& set) {
  return std::accumulate(set.begin(), set.end(), 0, [&weights](int sum, int a) {
    return sum + weights[a];
  });
}

ConsistencyMatrix DrawMatrix(int size, double density, Random* random) {
  ConsistencyMatrix matrix(size, std::vector<bool>(size, true));
  for (int a = 0; a < size; ++a) {
    for (int b = a + 1; b < size; ++b) {
      matrix[a][b] = matrix[b][a] = random->Uniform(0, 1) < density;
    }
  }
  return matrix;
}

// True loop closures are consistent; false ones agree with few, by chance.
TEST(FindConsistentSet, FindsThePlantedSet) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    constexpr int kSize = 60;
    constexpr int kNumTrue = 20;
    ConsistencyMatrix matrix = DrawMatrix(kSize, 0.3, &random);
    for (int a = 0; a < kNumTrue; ++a) {
      for (int b = 0; b < kNumTrue; ++b) matrix[a][b] = true;
    }
    const std::vector<int> set =
        FindConsistentSet(matrix, std::vector<int>(kSize, 1));
    for (int a = 0; a < kNumTrue; ++a) {
      EXPECT_TRUE(std::binary_search(set.begin(), set.end(), a))
          << "seed " << seed;
    }
  }
}

// Compared with all subsets: the result is a maximal clique, not much lighter
// than the maximum clique.
TEST(FindConsistentSet, NearTheMaximumOfAllSubsets) {
  constexpr int kSize = 12;
  constexpr int kNumDraws = 40;
  for (uint64_t seed = 1; seed <= kNumDraws; ++seed) {
    Random random(seed);
    const ConsistencyMatrix matrix = DrawMatrix(kSize, 0.6, &random);
    std::vector<int> weights;
    for (int a = 0; a < kSize; ++a) {
      weights.push_back(1 + static_cast<int>(random.Uniform(0, 5)));
    }
    int maximum = 0;
    for (int mask = 1; mask < 1 << kSize; ++mask) {
      std::vector<int> set;
      for (int a = 0; a < kSize; ++a) {
        if (mask >> a & 1) set.push_back(a);
      }
      if (IsClique(matrix, set)) {
        maximum = std::max(maximum, Weigh(weights, set));
      }
    }
    const std::vector<int> set = FindConsistentSet(matrix, weights);
    EXPECT_TRUE(IsClique(matrix, set));
    for (int a = 0; a < kSize; ++a) {
      std::vector<int> larger = set;
      if (std::find(larger.begin(), larger.end(), a) != larger.end()) continue;
      larger.push_back(a);
      EXPECT_FALSE(IsClique(matrix, larger));
    }
    EXPECT_GE(Weigh(weights, set), 0.7 * maximum) << "seed " << seed;
  }
}

// One loop of many pairs outweighs several loops of one pair each.
TEST(FindConsistentSet, WeightsDecide) {
  ConsistencyMatrix matrix(5, std::vector<bool>(5, false));
  for (const int a : {0, 1, 2}) {
    for (const int b : {0, 1, 2}) matrix[a][b] = true;
  }
  matrix[3][4] = matrix[4][3] = true;
  EXPECT_EQ(FindConsistentSet(matrix, {1, 1, 1, 1, 1}),
            (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(FindConsistentSet(matrix, {1, 1, 1, 9, 1}),
            (std::vector<int>{3, 4}));
  EXPECT_TRUE(FindConsistentSet({}, {}).empty());
}

}  // namespace
}  // namespace adasfm
