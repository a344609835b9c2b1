// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/calibrate_focal_lengths.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/colmap_ext/synthetic_scene.h"
#include "tests/testing/colmap_ext/unknown_lens.h"

namespace adasfm {
namespace {

SyntheticWorldOptions Drive(uint64_t seed) {
  SyntheticWorldOptions options;
  options.seed = seed;
  options.num_images = 80;
  return options;
}

SceneData SceneWithFocalLength(const SyntheticWorld& world, double factor) {
  SyntheticPriorOptions priors;
  priors.enabled = false;
  SceneData scene = BuildSyntheticScene(world, priors);
  colmap::Camera& camera = scene.cameras.at(1);
  camera.SetPriorFocalLength(false);
  for (const size_t index : camera.FocalLengthIdxs()) {
    camera.Params(index) *= factor;
  }
  return scene;
}

// COLMAP's guess is 50 % too long for phones, and too short for other cameras.
TEST(CalibrateFocalLengths, FindsTheTruthWithinItsSigma) {
  for (const uint64_t seed : {1, 2, 3, 4}) {
    const SyntheticWorld world = BuildSyntheticWorld(Drive(seed));
    for (const double factor : {0.7, 1.6}) {
      SceneData scene = SceneWithFocalLength(world, factor);
      const auto found =
          CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
      ASSERT_EQ(found.size(), 1) << seed << ", " << factor;
      EXPECT_DOUBLE_EQ(found[0].given_px, factor * world.camera.focal_px);
      EXPECT_LT(found[0].relative_sigma, 0.03);
      EXPECT_NEAR(std::log(found[0].found_px / world.camera.focal_px), 0.0,
                  4.0 * found[0].relative_sigma);
      EXPECT_EQ(scene.cameras.at(1).MeanFocalLength(), found[0].found_px);
      EXPECT_EQ(scene.cameras.at(1).PrincipalPointX(),
                world.camera.principal_x_px);
    }
  }
}

// If distortion were neglected, the focal length of the second seed would be
// 26 % too long, at a sigma of 2 %.
TEST(CalibrateFocalLengths, FindsTheTruthOfADistortingLens) {
  constexpr double kDistortion = -0.08;
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(Drive(seed));
    SceneData scene = SceneWithFocalLength(world, 1.0);
    UseUnknownLens(kDistortion, 0.0, 1.6, &scene);
    const colmap::Camera& camera = scene.cameras.at(1);
    const auto found =
        CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
    ASSERT_EQ(found.size(), 1) << seed;
    EXPECT_LT(found[0].relative_sigma, 0.04);
    EXPECT_NEAR(std::log(found[0].found_px / world.camera.focal_px), 0.0,
                4.0 * found[0].relative_sigma);
    EXPECT_NEAR(camera.Params(3), kDistortion, 0.04);
  }
}

// A phone's lens: distortion outwards near the middle, inwards at the rim.
TEST(CalibrateFocalLengths, FindsTheTruthOfALensWithTwoRadialTerms) {
  constexpr double kFirst = 0.12;
  constexpr double kSecond = -0.12;
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(Drive(seed));
    SceneData scene = SceneWithFocalLength(world, 1.0);
    UseUnknownLens(kFirst, kSecond, 1.6, &scene);
    const colmap::Camera& camera = scene.cameras.at(1);
    const auto found =
        CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
    ASSERT_EQ(found.size(), 1) << seed;
    EXPECT_EQ(camera.ModelName(), "RADIAL");
    EXPECT_FALSE(camera.HasPriorFocalLength());
    EXPECT_NEAR(std::log(found[0].found_px / world.camera.focal_px), 0.0,
                4.0 * found[0].relative_sigma)
        << seed;
    EXPECT_LT(found[0].relative_sigma, 0.05);
    EXPECT_NEAR(camera.Params(3), kFirst, 0.06) << seed;
    EXPECT_NEAR(camera.Params(4), kSecond, 0.06) << seed;
  }
}

// With a rolling shutter every pair has a focal length of its own. The search
// must converge, to within 2 sigmas of DescribeFocalLength (3.5 %).
TEST(CalibrateFocalLengths, FindsALensBehindARollingShutter) {
  for (const uint64_t seed : {1, 2, 3}) {
    for (const double spacing_m : {1.5, 4.0}) {
      SyntheticWorldOptions options = Drive(seed);
      options.rolling_shutter_s = 0.03;
      options.spacing_m = spacing_m;
      const SyntheticWorld world = BuildSyntheticWorld(options);
      SceneData scene = SceneWithFocalLength(world, 1.0);
      UseUnknownLens(0.07, -0.09, 1.6, &scene);
      const auto found =
          CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
      ASSERT_EQ(found.size(), 1) << seed << ", " << spacing_m;
      EXPECT_NEAR(std::log(found[0].found_px / world.camera.focal_px), 0.0,
                  2.0 * 0.035)
          << seed << ", " << spacing_m;
    }
  }
}

// A right focal length is no reason to leave out the distortion.
TEST(CalibrateFocalLengths, FindsTheDistortionAtARightFocalLength) {
  const SyntheticWorld world = BuildSyntheticWorld(Drive(1));
  SceneData scene = SceneWithFocalLength(world, 1.0);
  UseUnknownLens(-0.08, 0.0, 1.0, &scene);
  const auto found =
      CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
  ASSERT_EQ(found.size(), 1);
  EXPECT_NEAR(scene.cameras.at(1).Params(3), -0.08, 0.04);
}

// Guesses by different programs lead to the same lens.
TEST(CalibrateFocalLengths, WhatIsGivenDoesNotMatter) {
  for (const uint64_t seed : {1, 2}) {
    const SyntheticWorld world = BuildSyntheticWorld(Drive(seed));
    std::vector<double> found_px;
    for (const double factor : {0.5, 1.4, 2.3}) {
      SceneData scene = SceneWithFocalLength(world, 1.0);
      UseUnknownLens(-0.08, 0.0, factor, &scene);
      const auto found =
          CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
      ASSERT_EQ(found.size(), 1) << seed << ", " << factor;
      found_px.push_back(found[0].found_px);
      EXPECT_NEAR(found_px.back(), found_px.front(), 1e-6 * found_px.front());
    }
  }
}

TEST(CalibrateFocalLengths, KnownAndRightOnesStay) {
  const SyntheticWorld world = BuildSyntheticWorld(Drive(1));
  SceneData known = SceneWithFocalLength(world, 1.6);
  known.cameras.at(1).SetPriorFocalLength(true);
  EXPECT_TRUE(
      CalibrateFocalLengths(FocalLengthCalibrationOptions(), &known).empty());
  EXPECT_EQ(known.cameras.at(1).MeanFocalLength(), 1.6 * world.camera.focal_px);
  FocalLengthCalibrationOptions off;
  off.enabled = false;
  SceneData unknown = SceneWithFocalLength(world, 1.6);
  EXPECT_TRUE(CalibrateFocalLengths(off, &unknown).empty());
}

// Pairs without rotation do not determine a focal length, and none is made up.
TEST(CalibrateFocalLengths, StraightOnNothingIsTaken) {
  const SyntheticWorld world = BuildSyntheticWorld(Drive(2));
  SceneData scene = SceneWithFocalLength(world, 1.6);
  std::vector<ScenePair> straight;
  for (const ScenePair& pair : scene.pairs) {
    const auto pose = [&world](image_t image_id) {
      return world.images.at(image_id - 1).cam_from_world;
    };
    const Rigid3d motion =
        ComputeCam2FromCam1(pose(pair.image_id1), pose(pair.image_id2));
    if (LogSo3(motion.rotation).norm() < DegToRad(1.0)) {
      straight.push_back(pair);
    }
  }
  ASSERT_GT(straight.size(), 20);
  scene.pairs = straight;
  const auto found =
      CalibrateFocalLengths(FocalLengthCalibrationOptions(), &scene);
  // A focal length that is found nevertheless is right within its sigma.
  for (const CalibratedFocalLength& calibrated : found) {
    EXPECT_NEAR(std::log(calibrated.found_px / world.camera.focal_px), 0.0,
                4.0 * calibrated.relative_sigma);
  }
}

}  // namespace
}  // namespace adasfm
