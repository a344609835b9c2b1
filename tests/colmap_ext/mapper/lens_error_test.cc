// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/lens_error.h"

#include <gtest/gtest.h>

#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

// The lens error if the camera's model and parameters are stated as given.
LensError MeasureAdjusted(const BundleWorldOptions& options,
                          const std::string& stated_model,
                          const std::vector<double>& stated_params) {
  colmap::Reconstruction reconstruction = BuildBundleWorld(options);
  colmap::Camera& camera = reconstruction.Camera(1);
  camera.SetModelIdFromName(stated_model);
  camera.SetParams(stated_params);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.priors = TruePriors(options);
  // Twice, as the mapper's rounds do: the first finds the noise from residuals
  // before any adjustment.
  double keypoint_sigma_factor = 1.0;
  for (int round = 0; round < 2; ++round) {
    EXPECT_TRUE(AdjustBundleWithVarianceComponents(
                    {}, {}, problem, &reconstruction, &keypoint_sigma_factor)
                    .success);
  }
  const std::map<camera_t, LensError> errors =
      MeasureLensErrors(reconstruction);
  EXPECT_EQ(errors.size(), 1);
  return errors.at(1);
}

BundleWorldOptions World(const std::string& camera_model) {
  BundleWorldOptions options;
  options.num_images = 40;
  options.num_keypoints_per_image = 300;
  options.pixel_noise_px = 0.2;
  // If the camera only looked along the drive, changed depths of points could
  // explain any lens.
  options.weave_rad = 0.8;
  options.camera_model = camera_model;
  if (camera_model != "PINHOLE") {
    options.camera_params = {480, 485, 400, 250, 0, 0, 0, 0};
  }
  return options;
}

TEST(LensErrorTest, RightModelsHaveNone) {
  for (const char* model : {"PINHOLE", "OPENCV", "OPENCV_FISHEYE"}) {
    for (const uint64_t seed : {1, 2, 3}) {
      BundleWorldOptions options = World(model);
      options.seed = seed;
      const LensError error =
          MeasureAdjusted(options, model, options.camera_params);
      EXPECT_LT(error.ratio, 0.05) << model << ", seed " << seed;
      EXPECT_LT(error.rms_px, 0.05) << model << ", seed " << seed;
    }
  }
}

// The camera looks along the street, so that the points absorb much of the
// error.
TEST(LensErrorTest, AnotherModelShows) {
  const std::vector<double> no_distortion = {480, 485, 400, 250};
  const std::vector<double> barrel = {480, 485, 400, 250, -0.15, 0, 0, 0};
  for (const uint64_t seed : {1, 2, 3}) {
    BundleWorldOptions fisheye = World("OPENCV_FISHEYE");
    BundleWorldOptions pinhole = World("PINHOLE");
    fisheye.seed = pinhole.seed = seed;
    EXPECT_GT(MeasureAdjusted(fisheye, "PINHOLE", no_distortion).ratio, 0.15)
        << seed;
    EXPECT_GT(
        MeasureAdjusted(pinhole, "OPENCV_FISHEYE", fisheye.camera_params).ratio,
        0.15)
        << seed;
    EXPECT_GT(MeasureAdjusted(pinhole, "OPENCV", barrel).ratio, 0.08) << seed;
  }
}

// The sigma is that of the residuals; the shared error stays.
TEST(LensErrorTest, NoiseHidesIt) {
  BundleWorldOptions options = World("PINHOLE");
  const std::vector<double> barrel = {480, 485, 400, 250, -0.05, 0, 0, 0};
  const LensError sharp = MeasureAdjusted(options, "OPENCV", barrel);
  options.pixel_noise_px = 1.5;
  const LensError blurred = MeasureAdjusted(options, "OPENCV", barrel);
  EXPECT_LT(blurred.ratio, 0.6 * sharp.ratio);
}

TEST(LensErrorTest, NothingToTellFrom) {
  EXPECT_TRUE(MeasureLensErrors(colmap::Reconstruction()).empty());
  BundleWorldOptions options;
  options.num_images = 4;
  EXPECT_TRUE(MeasureLensErrors(BuildBundleWorld(options)).empty());
}

}  // namespace
}  // namespace adasfm
