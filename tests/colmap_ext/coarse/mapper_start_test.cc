// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/mapper_start.h"

#include <gtest/gtest.h>

#include "core/so3.h"

namespace adasfm {
namespace {

RefinedPair MakePair(image_t image_id2, int num_matches, double parallax_deg,
                     const Eigen::Vector3d& translation) {
  RefinedPair pair;
  pair.pair = ImagePair(1, image_id2);
  pair.cam2_from_cam1.translation = translation;
  pair.matches.resize(num_matches);
  pair.median_parallax_rad = DegToRad(parallax_deg);
  return pair;
}

const Eigen::Vector3d kAhead(0.01, 0.0, -2.0);
const Eigen::Vector3d kAside(-3.0, 0.0, 0.0);

TEST(FindMapperStartTest, ADriveStraightAheadHasToBeTold) {
  // Neighbours with most matches, the widest pair with too few, one in between.
  const std::optional<MapperStart> start = FindMapperStart(
      {MakePair(2, 2000, 0.3, kAhead), MakePair(9, 240, 3.3, kAhead),
       MakePair(17, 75, 7.4, kAside)});
  ASSERT_TRUE(start.has_value());
  EXPECT_EQ(start->pair, ImagePair(1, 9));
  EXPECT_EQ(start->num_matches, 240);
  EXPECT_NEAR(RadToDeg(start->parallax_rad), 3.3, 1e-9);
  EXPECT_TRUE(start->must_be_told);
}

TEST(FindMapperStartTest, AWideParallaxAheadHasToBeToldToo) {
  const RefinedPair ahead = MakePair(2, 300, 20.0, kAhead);
  EXPECT_TRUE(FindMapperStart({ahead})->must_be_told);
  EXPECT_FALSE(
      FindMapperStart({ahead, MakePair(3, 150, 20.0, kAside)})->must_be_told);
  // Beyond 16 degrees of parallax the number of matches decides.
  EXPECT_EQ(FindMapperStart({ahead, MakePair(3, 150, 40.0, kAside)})->pair,
            ahead.pair);
}

TEST(FindMapperStartTest, FewMatchesAndRemovedPairsAreNone) {
  RefinedPair removed = MakePair(2, 500, 20.0, kAside);
  removed.removed = true;
  EXPECT_FALSE(
      FindMapperStart({removed, MakePair(3, 99, 20.0, kAside)}).has_value());
  EXPECT_FALSE(FindMapperStart({}).has_value());
}

}  // namespace
}  // namespace adasfm
