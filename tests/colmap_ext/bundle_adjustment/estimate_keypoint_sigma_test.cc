// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"

#include <gtest/gtest.h>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "core/random.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

colmap::Reconstruction AdjustedWorld(const BundleWorldOptions& options) {
  colmap::Reconstruction reconstruction = BuildBundleWorld(options);
  EXPECT_TRUE(
      AdjustBundle({}, ProblemOfAll(reconstruction), &reconstruction).success);
  return reconstruction;
}

TEST(EstimateKeypointSigmaTest, FindsTheNoiseOfTheWorld) {
  for (const double noise_px : {0.2, 0.7, 1.5}) {
    for (const uint64_t seed : {1, 2, 3}) {
      BundleWorldOptions options;
      options.seed = seed;
      options.pixel_noise_px = noise_px;
      const std::optional<double> sigma_px =
          EstimateKeypointSigmas(AdjustedWorld(options)).of_all_px;
      ASSERT_TRUE(sigma_px.has_value());
      // The median of some hundred points is accurate to 4 %.
      EXPECT_NEAR(*sigma_px / noise_px, 1.0, 0.1) << "seed " << seed;
    }
  }
}

TEST(EstimateKeypointSigmaTest, FindsTheNoiseOfEachCamera) {
  for (const uint64_t seed : {1, 2, 3}) {
    BundleWorldOptions options;
    options.seed = seed;
    options.num_images = 40;
    options.num_keypoints_per_image = 400;
    options.pixel_noise_px = 0.3;
    options.second_camera_noise_px = 1.2;
    const std::map<camera_t, double> sigmas_px =
        EstimateKeypointSigmas(AdjustedWorld(options)).of_cameras_px;
    ASSERT_EQ(sigmas_px.size(), 2);
    // More than three times the scatter over ten seeds.
    EXPECT_NEAR(sigmas_px.at(1) / 0.3, 1.0, 0.1) << "seed " << seed;
    EXPECT_NEAR(sigmas_px.at(2) / 1.2, 1.0, 0.1) << "seed " << seed;
  }
  EXPECT_TRUE(EstimateKeypointSigmas(AdjustedWorld({})).of_cameras_px.empty());
}

TEST(EstimateKeypointSigmaTest, WrongMatchesDoNotCount) {
  BundleWorldOptions options;
  options.pixel_noise_px = 0.5;
  colmap::Reconstruction reconstruction = AdjustedWorld(options);
  Random random(1);
  for (const colmap::image_t image_id : reconstruction.RegImageIds()) {
    colmap::Image& image = reconstruction.Image(image_id);
    for (colmap::point2D_t k = 0; k < image.NumPoints2D(); ++k) {
      if (random.Uniform(0.0, 1.0) > 0.02) continue;
      image.Point2D(k).SetXY(image.Point2D(k).XY() +
                             Eigen::Vector2d(20.0, -10.0));
    }
  }
  const std::optional<double> sigma_px =
      EstimateKeypointSigmas(reconstruction).of_all_px;
  ASSERT_TRUE(sigma_px.has_value());
  // A tenth of the points has a wrong observation, which moves the median.
  EXPECT_NEAR(*sigma_px, 0.5, 0.1);
}

TEST(MaxReprojErrorTest, IsFourSigmasAndTheOneGivenAtLeast) {
  BundleWorldOptions options;
  options.pixel_noise_px = 0.5;
  const colmap::Reconstruction reconstruction = AdjustedWorld(options);
  const double four_sigmas_px =
      4.0 * EstimateKeypointSigmas(reconstruction).of_all_px.value();
  EXPECT_EQ(MaxReprojErrorPx(1.0, reconstruction), four_sigmas_px);
  EXPECT_EQ(MaxReprojErrorPx(4.0, reconstruction), 4.0);
  EXPECT_EQ(MaxReprojErrorPx(4.0, colmap::Reconstruction()), 4.0);
}

TEST(EstimateKeypointSigmaTest, NothingToTellFrom) {
  EXPECT_FALSE(
      EstimateKeypointSigmas(colmap::Reconstruction()).of_all_px.has_value());
}

}  // namespace
}  // namespace adasfm
