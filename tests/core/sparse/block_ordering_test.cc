// SPDX-License-Identifier: BSD-3-Clause
#include "core/sparse/block_ordering.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "core/parallel.h"

namespace adasfm {
namespace {

using Neighbors = std::vector<std::vector<int>>;

size_t NumFactorBlocks(const Neighbors& neighbors) {
  return FindBlockOrdering(neighbors).num_factor_blocks;
}

TEST(BlockOrderingTest, KnowsGraphsWithoutFill) {
  EXPECT_EQ(NumFactorBlocks({}), 0);
  Neighbors chain(50);
  Neighbors star(50);
  for (int i = 0; i + 1 < 50; ++i) {
    chain[i].push_back(i + 1);
    star[0].push_back(i + 1);
  }
  EXPECT_EQ(NumFactorBlocks(chain), 49);
  EXPECT_EQ(NumFactorBlocks(star), 49);
}

TEST(BlockOrderingTest, ACompleteGraphIsFull) {
  Neighbors neighbors(30);
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < i; ++j) neighbors[i].push_back(j);
  }
  EXPECT_EQ(NumFactorBlocks(neighbors), 30 * 29 / 2);
}

// 0 - 1 - 2 - 3 - 4 - 5 - 0: eliminating any node connects its two neighbours,
// until a triangle is left.
TEST(BlockOrderingTest, ARingFills) {
  Neighbors ring(6);
  for (int i = 0; i < 6; ++i) ring[i].push_back((i + 1) % 6);
  EXPECT_EQ(NumFactorBlocks(ring), 6 + 3);
}

// The factor of a drive that sees each place once is banded, however long the
// drive; crossing streets cause more fill.
TEST(BlockOrderingTest, GrowsWithTheStreetsThatCross) {
  const int num_images = 400;
  Neighbors straight(num_images);
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < std::min(num_images, i + 4); ++j) {
      straight[i].push_back(j);
    }
  }
  const size_t band = NumFactorBlocks(straight);
  EXPECT_EQ(band, 3 * num_images - 6);
  Neighbors crossing = straight;
  for (int i = 0; i < num_images; i += 20) {
    crossing[i].push_back((i * 7 + 190) % num_images);
  }
  EXPECT_GT(NumFactorBlocks(crossing), band);
}

// A mower's lanes, each image connected to those around it: nested dissection
// causes less fill than minimum degree.
Neighbors MakeLanes(int num_lanes, int lane_length) {
  const int num_images = num_lanes * lane_length;
  Neighbors lanes(num_images);
  for (int i = 0; i < num_images; ++i) {
    for (const int step : {1, lane_length - 1, lane_length, lane_length + 1}) {
      if (i + step < num_images) lanes[i].push_back(i + step);
    }
  }
  return lanes;
}

TEST(BlockOrderingTest, TheBoundIsNearTheFactor) {
  EXPECT_EQ(BoundNumFactorBlocks({}), 0);
  for (const int num_lanes : {20, 120}) {  // 400 and 2,400 images.
    const Neighbors lanes = MakeLanes(num_lanes, 20);
    const size_t exact = NumFactorBlocks(lanes);
    EXPECT_GE(BoundNumFactorBlocks(lanes), exact);
    EXPECT_LE(BoundNumFactorBlocks(lanes), 1.25 * exact);
  }
}

// Orderings must not depend on rand(), which METIS uses and COLMAP's threads
// seed.
TEST(BlockOrderingTest, OrdersSideBySideAreThoseOfOneThread) {
  std::vector<Neighbors> graphs;
  std::vector<std::vector<int>> expected;
  for (int i = 0; i < 4; ++i) {
    graphs.push_back(MakeLanes(12 + i, 20));
    expected.push_back(FindBlockOrdering(graphs[i]).block_of_number);
  }
  std::vector<int> num_others(graphs.size(), 0);
  ParallelFor(4, graphs.size(), [&](size_t i) {
    for (int k = 0; k < 100; ++k) {
      std::srand(k);
      num_others[i] +=
          FindBlockOrdering(graphs[i]).block_of_number != expected[i];
    }
  });
  EXPECT_EQ(num_others, std::vector<int>(graphs.size(), 0));
}

}  // namespace
}  // namespace adasfm
