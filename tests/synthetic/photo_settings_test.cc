// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/photo_settings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "synthetic/world_summary.h"
#include "tests/testing/synthetic/world_properties.h"

namespace adasfm {
namespace {

TEST(SetFocalFactors, PixelsMoveByTheirShareFromThePrincipalPoint) {
  for (const auto model :
       {SyntheticCameraModel::kPinhole, SyntheticCameraModel::kFisheye}) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.camera_model = model;
    options.pixel_noise_px = 0.0;
    options.moving_keypoint_ratio =
        model == SyntheticCameraModel::kPinhole ? 0.2 : 0.0;
    const SyntheticWorld stated = BuildSyntheticWorld(options);
    options.focal_breathing_ratio = 0.02;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    EXPECT_EQ(world.camera.focal_px, stated.camera.focal_px);
    const Eigen::Vector2d principal(world.camera.principal_x_px,
                                    world.camera.principal_y_px);
    double largest = 0.0;
    int num_compared = 0;
    for (size_t i = 0; i < world.images.size(); ++i) {
      const SyntheticImage& image = world.images[i];
      const SyntheticImage& before = stated.images[i];
      largest = std::max(largest, std::abs(image.focal_factor - 1.0));
      std::map<int, Eigen::Vector2d> pixels;
      for (size_t k = 0; k < before.keypoints.size(); ++k) {
        pixels[before.landmark_ids[k]] = before.keypoints[k];
      }
      for (size_t k = 0; k < image.keypoints.size(); ++k) {
        const auto pixel = pixels.find(image.landmark_ids[k]);
        if (pixel == pixels.end()) continue;
        const Eigen::Vector2d moved =
            principal + image.focal_factor * (pixel->second - principal);
        EXPECT_LT((moved - image.keypoints[k]).norm(), 1e-9);
        ++num_compared;
      }
    }
    EXPECT_GT(num_compared, 60 * 80);
    EXPECT_NEAR(largest, 0.02, 1e-12);
    EXPECT_NEAR(SummarizeWorld(world).max_focal_error_percent, 2.0, 1e-9);
    EXPECT_EQ(SummarizeWorld(stated).max_focal_error_percent, 0.0);
  }
}

TEST(SetFocalFactors, WaveIsSlowAndStepsAreSudden) {
  SyntheticWorldOptions options;
  options.num_images = 200;
  options.num_keypoints_per_image = 20;
  options.stereo_baseline_m = 0.5;
  options.focal_breathing_ratio = 0.01;
  for (const int num_steps : {0, 7}) {
    options.num_focal_steps = num_steps;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    int num_changes = 0;
    double largest = 0.0;
    for (int i = 1; i < options.num_images; ++i) {
      const double change = std::abs(world.images[i].focal_factor -
                                     world.images[i - 1].focal_factor);
      num_changes += change > 0.0;
      largest = std::max(largest, change);
    }
    EXPECT_EQ(num_changes, num_steps > 0 ? num_steps : 199);
    EXPECT_EQ(largest > 0.004, num_steps > 0);
    // The factors are the same for both cameras.
    EXPECT_EQ(world.images[200 + 50].focal_factor,
              world.images[50].focal_factor);
  }
}

TEST(SetExposureGains, JumpByTheFactorAtTheShareOfPhotos) {
  SyntheticWorldOptions options;
  options.num_images = 101;
  options.num_keypoints_per_image = 20;
  options.stereo_baseline_m = 0.5;
  for (const double ratio : {0.0, 0.2, 1.0}) {
    options.exposure_jump_ratio = ratio;
    options.exposure_jump_factor = 3.0;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    int num_jumps = 0;
    EXPECT_EQ(world.images[0].exposure_gain, 1.0);
    for (int i = 1; i < 101; ++i) {
      const double step =
          world.images[i].exposure_gain / world.images[i - 1].exposure_gain;
      if (step != 1.0) {
        ++num_jumps;
        EXPECT_NEAR(std::abs(std::log(step)), std::log(3.0), 1e-12);
      }
      EXPECT_LE(std::abs(std::log(world.images[i].exposure_gain)),
                std::log(3.0) + 1e-12);
      EXPECT_EQ(world.images[101 + i].exposure_gain,
                world.images[i].exposure_gain);
    }
    EXPECT_EQ(num_jumps, std::lround(100 * ratio));
    const SyntheticWorldSummary summary = SummarizeWorld(world);
    EXPECT_NEAR(summary.exposure_jump_ratio, ratio, 1e-12);
    EXPECT_NEAR(summary.max_exposure_factor, ratio > 0.0 ? 3.0 : 1.0, 1e-12);
  }
}

TEST(OpenShutters, LastAsLongAsAskedForAroundTheImage) {
  SyntheticWorldOptions options;
  options.num_images = 60;
  options.num_keypoints_per_image = 20;
  options.trajectory = SyntheticTrajectory::kStraight;
  EXPECT_FALSE(BuildSyntheticWorld(options).images[0].shutter);
  options.exposure_time_s = 0.04;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  for (size_t i = 30; i + 1 < world.images.size(); ++i) {
    const SyntheticImage& image = world.images[i];
    const auto center = [](const Rigid3d& pose) {
      return pose.TargetOriginInSource();
    };
    const Eigen::Vector3d now = center(image.cam_from_world);
    ASSERT_TRUE(image.shutter);
    const double speed_m_per_s =
        (center(world.images[i + 1].cam_from_world) -
         center(world.images[i - 1].cam_from_world))
            .norm() /
        SecondsFromNs(world.images[i + 1].timestamp_ns -
                      world.images[i - 1].timestamp_ns);
    const double way_m = (center(image.shutter->last_cam_from_world) -
                          center(image.shutter->first_cam_from_world))
                             .norm();
    EXPECT_NEAR(way_m, 0.04 * speed_m_per_s, 0.1 * way_m);
    EXPECT_LT((center(image.shutter->CamFromWorldAt(0.5)) - now).norm(),
              0.01 * way_m);
  }
}

TEST(OpenShutters, NeverReachTheNextImage) {
  SyntheticWorldOptions options;
  options.num_images = 30;
  options.image_interval_s = 0.06;
  options.exposure_time_s = 0.09;
  const std::string error = BuildError(options);
  const std::string phrase = "largest possible value of this drive is ";
  ASSERT_NE(error.find(phrase), std::string::npos) << error;
  EXPECT_NE(error.find("exposure_time_s = 0.09"), std::string::npos);
  const double largest =
      std::stod(error.substr(error.find(phrase) + phrase.size()));
  EXPECT_NEAR(largest, 0.06, 0.015);
  options.exposure_time_s = largest - 1e-5;
  EXPECT_EQ(BuildError(options), "");
  options.exposure_time_s = largest + 1e-5;
  EXPECT_NE(BuildError(options), "");
}

// f = 100 px. The point is 1 m beside the axis and first 10 m, then 9 m ahead.
TEST(ComputeBlurLengths, IsTheWayOfThePixel) {
  SyntheticWorld world;
  world.camera.focal_px = 100.0;
  world.landmarks = {Eigen::Vector3d(1.0, 0.0, 10.0)};
  SyntheticImage image;
  image.landmark_ids = {0, 1};  // the second one on a car
  image.keypoints.resize(2);
  EXPECT_TRUE(ComputeBlurLengths(world, image).empty());
  const auto pose = [](double z) {
    return Rigid3d(Eigen::Quaterniond::Identity(),
                   Eigen::Vector3d(0.0, 0.0, -z));
  };
  image.shutter = ExposurePoses{pose(0.0), pose(1.0)};
  const double length_px = 100.0 / 9.0 - 100.0 / 10.0;
  ASSERT_EQ(ComputeBlurLengths(world, image).size(), 1);
  EXPECT_NEAR(ComputeBlurLengths(world, image)[0], length_px, 1e-9);
  image.focal_factor = 1.1;
  EXPECT_NEAR(ComputeBlurLengths(world, image)[0], 1.1 * length_px, 1e-9);
  // Three photos, the third with twice the path: 1.11, 1.11 and 2.5 px.
  image.focal_factor = 1.0;
  image.keypoints.resize(20);
  image.landmark_ids.assign(20, 0);
  world.images = {image, image, image};
  world.images[2].shutter->last_cam_from_world = pose(2.0);
  const SyntheticWorldSummary summary = SummarizeWorld(world);
  EXPECT_NEAR(summary.max_blur_px, 2.5, 1e-9);
  EXPECT_NEAR(summary.mean_blur_px, (2.0 * length_px + 2.5) / 3.0, 1e-9);
  EXPECT_NEAR(summary.blurred_photo_ratio, 1.0 / 3.0, 1e-12);
}

TEST(PhotoSettings, ImpossibleValuesAreNamed) {
  const auto error_of = [](const SyntheticWorldOptions& options) {
    std::string error;
    EXPECT_FALSE(options.IsValid(&error));
    return error;
  };
  SyntheticWorldOptions options;
  options.exposure_time_s = 0.2;
  EXPECT_EQ(error_of(options), "exposure_time_s = 0.2 must be from 0 to 0.1");
  options = SyntheticWorldOptions();
  options.exposure_jump_ratio = 1.5;
  EXPECT_EQ(error_of(options), "exposure_jump_ratio = 1.5 must be from 0 to 1");
  options = SyntheticWorldOptions();
  options.exposure_jump_factor = 1.0;
  EXPECT_EQ(error_of(options),
            "exposure_jump_factor = 1 must be from 1.1 to 16");
  options = SyntheticWorldOptions();
  options.focal_breathing_ratio = -0.01;
  EXPECT_EQ(error_of(options),
            "focal_breathing_ratio = -0.01 must be from 0 to 0.2");
  options = SyntheticWorldOptions();
  options.num_focal_steps = 100;
  EXPECT_EQ(error_of(options),
            "num_focal_steps = 100 must be less than num_images");
}

}  // namespace
}  // namespace adasfm
