// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/capture_order.h"

#include <gtest/gtest.h>

#include <map>

#include "global/view_graph/view_graph.h"

namespace adasfm {
namespace {

TEST(OrderByCapture, NumbersInNamesCountAsNumbers) {
  bool by_time = true;
  EXPECT_EQ(OrderByCapture({{1, "b/2.png", {}},
                            {2, "a/10.png", {}},
                            {3, "a/9.png", {}},
                            {4, "a/09x.png", {}}},
                           &by_time),
            (std::vector<image_t>{3, 4, 2, 1}));
  EXPECT_FALSE(by_time);
}

TEST(OrderByCapture, TimesComeFirstWhereAllImagesHaveOne) {
  bool by_time = false;
  EXPECT_EQ(
      OrderByCapture({{1, "1", 30}, {2, "2", 10}, {3, "3", 20}}, &by_time),
      (std::vector<image_t>{2, 3, 1}));
  EXPECT_TRUE(by_time);
  EXPECT_EQ(OrderByCapture({{1, "1", 30}, {2, "2", {}}, {3, "3", 20}}),
            (std::vector<image_t>{1, 2, 3}));
  EXPECT_TRUE(OrderByCapture({}).empty());
}

std::map<image_t, int64_t> RanksOf(const std::vector<CapturedImage>& images) {
  std::map<image_t, int64_t> ranks;
  for (const auto& [image_id, rank] : RankByCapture(images)) {
    // The images are given in the order of capture.
    EXPECT_EQ(rank.position, image_id - 1);
    ranks[image_id] = rank.rank;
  }
  return ranks;
}

// Three robots, of which the third starts when the second has stopped, and an
// image without logs.
TEST(RankByCapture, DrivesAtTheSameTimeAreFarApart) {
  const auto ranks = RanksOf({{1, "", 10, 0},
                              {2, "", 11, 1},
                              {3, "", 20, 0},
                              {4, "", 21, 1},
                              {5, "", 22, 2},
                              {6, "", 30, 0},
                              {7, "", 31, 2},
                              {8, "", 32, -1}});
  const std::map<image_t, int64_t> expected = {{1, 0},
                                               {3, 1},
                                               {6, 2},
                                               {8, 3},
                                               {2, kRankGapOfDrives},
                                               {4, kRankGapOfDrives + 1},
                                               {5, kRankGapOfDrives + 2},
                                               {7, kRankGapOfDrives + 3}};
  EXPECT_EQ(ranks, expected);
}

TEST(RankByCapture, DrivesThatFollowEachOtherAreOneSequence) {
  const auto ranks =
      RanksOf({{1, "", 10, 0}, {2, "", 11, 0}, {3, "", 20, 1}, {4, "", 21, 1}});
  const std::map<image_t, int64_t> expected = {{1, 0}, {2, 1}, {3, 2}, {4, 3}};
  EXPECT_EQ(ranks, expected);
}

}  // namespace
}  // namespace adasfm
