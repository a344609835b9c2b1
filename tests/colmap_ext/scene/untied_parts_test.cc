// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/untied_parts.h"

#include <gtest/gtest.h>

#include "tests/testing/colmap_ext/bundle_world.h"

namespace adasfm {
namespace {

// 30 images along a street, with only num_left of the points that images up to
// `last` share with later ones.
colmap::Reconstruction BuildCutWorld(image_t last, int num_left) {
  BundleWorldOptions options;
  options.num_images = 30;
  colmap::Reconstruction world = BuildBundleWorld(options);
  const auto ids = world.Point3DIds();
  for (const colmap::point3D_t id :
       std::set<colmap::point3D_t>(ids.begin(), ids.end())) {
    bool is_first = false, is_second = false;
    for (const auto& element : TrackOf(world.Point3D(id)).Elements()) {
      (element.image_id <= last ? is_first : is_second) = true;
    }
    if (is_first && is_second && --num_left < 0) world.DeletePoint3D(id);
  }
  return world;
}

RelativePosePrior Prior(image_t first, uint32_t flags) {
  RelativePosePrior prior;
  prior.image_id1 = first;
  prior.image_id2 = first + 1;
  prior.flags = flags;
  return prior;
}

TEST(FindUntiedParts, FindsThePartBehindACut) {
  EXPECT_TRUE(FindUntiedParts({}, BuildBundleWorld({})).empty());
  EXPECT_TRUE(FindUntiedParts({}, BuildCutWorld(10, 6)).empty());
  for (const int num_left : {0, 5}) {
    const auto parts = FindUntiedParts({}, BuildCutWorld(10, num_left));
    ASSERT_EQ(parts.size(), 1);
    EXPECT_EQ(parts[0].size(), 10);
    EXPECT_EQ(*parts[0].rbegin(), 10);
  }
}

TEST(FindUntiedParts, WholeMotionsTieAndRotationsDoNot) {
  const colmap::Reconstruction world = BuildCutWorld(10, 0);
  EXPECT_EQ(FindUntiedParts({Prior(10, kPriorRotation)}, world).size(), 1);
  const uint32_t whole = kPriorRotation | kPriorDirection | kPriorLength;
  EXPECT_TRUE(FindUntiedParts({Prior(10, whole)}, world).empty());
  // Priors within a part, or to an image that is not in the model.
  EXPECT_EQ(FindUntiedParts({Prior(3, whole), Prior(30, whole)}, world).size(),
            1);
}

// Images with next to no points are not a part of their own.
TEST(FindUntiedParts, FewPointsAreNoPart) {
  colmap::Reconstruction world = BuildCutWorld(1, 0);
  EXPECT_TRUE(FindUntiedParts({}, world).empty());
}

}  // namespace
}  // namespace adasfm
