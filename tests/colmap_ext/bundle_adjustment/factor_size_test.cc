// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/factor_size.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace adasfm {
namespace {

using Neighbors = std::vector<std::vector<int>>;

TEST(CountFactorBlocksTest, KnowsGraphsWithoutFill) {
  EXPECT_EQ(CountFactorBlocks({}), 0);
  Neighbors chain(50);
  Neighbors star(50);
  for (int i = 0; i + 1 < 50; ++i) {
    chain[i].push_back(i + 1);
    star[0].push_back(i + 1);
  }
  EXPECT_EQ(CountFactorBlocks(chain), 49);
  EXPECT_EQ(CountFactorBlocks(star), 49);
}

TEST(CountFactorBlocksTest, ACompleteGraphIsFull) {
  Neighbors neighbors(30);
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < i; ++j) neighbors[i].push_back(j);
  }
  EXPECT_EQ(CountFactorBlocks(neighbors), 30 * 29 / 2);
}

// 0 - 1 - 2 - 3 - 4 - 5 - 0: whichever node goes first joins its neighbours,
// until a triangle is left.
TEST(CountFactorBlocksTest, ARingFills) {
  Neighbors ring(6);
  for (int i = 0; i < 6; ++i) ring[i].push_back((i + 1) % 6);
  EXPECT_EQ(CountFactorBlocks(ring), 6 + 3);
}

// A drive that sees each place once stays a band, however long; streets that
// cross fill more.
TEST(CountFactorBlocksTest, GrowsWithTheStreetsThatCross) {
  const int num_images = 400;
  Neighbors straight(num_images);
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < std::min(num_images, i + 4); ++j) {
      straight[i].push_back(j);
    }
  }
  const size_t band = CountFactorBlocks(straight);
  EXPECT_EQ(band, 3 * num_images - 6);
  Neighbors crossing = straight;
  for (int i = 0; i < num_images; i += 20) {
    crossing[i].push_back((i * 7 + 190) % num_images);
  }
  EXPECT_GT(CountFactorBlocks(crossing), band);
}

}  // namespace
}  // namespace adasfm
