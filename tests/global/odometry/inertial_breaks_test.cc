// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/inertial_breaks.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "tests/testing/global/inertial_walk.h"

namespace adasfm {
namespace {

constexpr int kNumSeeds = 20;
constexpr double kUnit = 2.0;  // m

WalkData Walk(uint64_t seed) {
  WalkOptions options;
  options.metres_per_unit = kUnit;
  options.center_noise_m = 0.003;
  options.tilt_noise_rad = 0.003;
  return SimulateWalk(options, seed);
}

std::vector<std::set<image_t>> Find(const WalkData& walk) {
  return FindPartsByInertia(walk.motions, walk.rotations, walk.cams_from_world);
}

// Moves images first, ..., last; those that have no pose are passed over.
std::set<image_t> MoveImages(image_t first, image_t last,
                             const Eigen::Vector3d& way_m, WalkData* walk) {
  std::set<image_t> moved;
  for (image_t image_id = first; image_id <= last; ++image_id) {
    const auto pose = walk->cams_from_world.find(image_id);
    if (pose == walk->cams_from_world.end()) continue;
    pose->second.translation -= pose->second.rotation * way_m / kUnit;
    moved.insert(image_id);
  }
  return moved;
}

Eigen::Vector3d Way(uint64_t seed, double length_m) {
  Random random(seed);
  return length_m * random.GaussianVector(1.0).normalized();
}

// Exactly the images that were moved must be found.
void ExpectFound(image_t first, image_t last) {
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    WalkData walk = Walk(seed);
    const std::set<image_t> moved =
        MoveImages(first, last, Way(seed, 3.0), &walk);
    EXPECT_EQ(Find(walk), std::vector<std::set<image_t>>{moved})
        << "seed " << seed;
  }
}

TEST(FindPartsByInertia, AWholeWalkIsOnePart) {
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    EXPECT_TRUE(Find(Walk(seed)).empty()) << "seed " << seed;
  }
}

TEST(FindPartsByInertia, FindsABeginningThatLiesElsewhere) {
  ExpectFound(1, 60);
}

TEST(FindPartsByInertia, FindsItAcrossImagesWithoutPoses) {
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    WalkData walk = Walk(seed);
    for (image_t image_id = 61; image_id <= 63; ++image_id) {
      walk.cams_from_world.erase(image_id);
    }
    EXPECT_TRUE(Find(walk).empty()) << "seed " << seed;
    const std::set<image_t> moved = MoveImages(1, 63, Way(seed, 10.0), &walk);
    EXPECT_EQ(Find(walk), std::vector<std::set<image_t>>{moved})
        << "seed " << seed;
  }
}

TEST(FindPartsByInertia, WhatLiesBeforeAndAfterStaysTogether) {
  ExpectFound(81, 110);
}

TEST(FindPartsByInertia, AnImageThatIsWrongByItselfIsNoPart) {
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    WalkData walk = Walk(seed);
    MoveImages(80, 80, Way(seed, 3.0), &walk);
    EXPECT_TRUE(Find(walk).empty()) << "seed " << seed;
  }
}

TEST(FindPartsByInertia, SaysNothingWhereItDoesNotTellTheSize) {
  WalkData walk = Walk(1);
  MoveImages(1, 60, Way(1, 3.0), &walk);
  for (InertialMotion& motion : walk.motions) {  // in g, not m/s^2
    motion.delta_velocity /= 9.81;
    motion.delta_position /= 9.81;
  }
  EXPECT_TRUE(Find(walk).empty());
}

}  // namespace
}  // namespace adasfm
