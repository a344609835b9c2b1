// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/mapper_stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_stage/mapping_summary.h"
#include "tests/testing/colmap_ext/mapper_drive.h"
#include "tests/testing/colmap_ext/mapper_stage_fixture.h"

namespace adasfm {
namespace {

// The drift of a chain of num_images priors without vision: an upper bound of
// the error that the tests allow.
double PriorDriftM(const MapperWorldOptions& options) {
  const int n = options.world.num_images;
  const double length_m = n * options.world.spacing_m;
  return options.priors.translation_sigma_m * std::sqrt(1.0 * n) +
         options.priors.rotation_sigma_rad * std::sqrt(1.0 * n) * length_m /
             std::sqrt(3.0);
}

TEST_F(MapperStageTest, IsFarBetterThanTheCoarseModelInMetres) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    MapperWorldOptions options;
    options.world.num_images = 100;
    options.world.seed = seed;
    const MapperWorld world = BuildMapperWorld(options);
    const auto poses = Run(world);
    EXPECT_GT(summary_.plan.parts.size(), 1);
    for (const AlignSimilarityResult& alignment : summary_.aligned.alignments) {
      EXPECT_TRUE(alignment.success);
    }
    EXPECT_LE(summary_.aligned.separator_rmse_after,
              summary_.aligned.separator_rmse_before);
    AlignmentOptions rigid;
    rigid.estimate_scale = false;
    const AlignedErrors errors =
        ComputeAlignedErrors(poses, world.true_poses, rigid);
    EXPECT_EQ(errors.num_images, options.world.num_images);
    EXPECT_LT(errors.rmse_m, PriorDriftM(options));
    EXPECT_LT(errors.rmse_m, 0.5 * CoarseRmseM(world));
    // The scale is the mean of all lengths, each known to sigma / length.
    const double scale =
        ComputeAlignedErrors(poses, world.true_poses, {}).scale;
    EXPECT_NEAR(scale, 1.0,
                5.0 * options.priors.translation_sigma_m /
                    options.world.spacing_m /
                    std::sqrt(1.0 * options.world.num_images));
    // Gravity makes the world z-up.
    for (const auto& [image_id, pose] : poses) {
      const Eigen::Vector3d down =
          pose.rotation.conjugate() *
          *world.data.images.at(image_id).gravity_in_cam;
      EXPECT_LT(AngleBetweenRad(down, Eigen::Vector3d(0, 0, -1)), 0.02);
    }
  }
}

TEST_F(MapperStageTest, WorksWithoutSensors) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  options.priors.enabled = false;
  RunAndExpectBetterThanCoarse(options);
  EXPECT_FALSE(summary_.is_metric);
  EXPECT_FALSE(summary_.is_level);
}

// With a filter at 4 px, noise of 3 px would be estimated as 1.9 px.
TEST_F(MapperStageTest, FilterFollowsTheNoise) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    MapperWorldOptions options;
    options.world.num_images = 60;
    options.world.seed = seed;
    options.world.pixel_noise_px = 3.0;
    RunAndExpectBetterThanCoarse(options);
    EXPECT_NEAR(summary_.refine.keypoint_sigma_px, 3.0, 0.3) << "seed " << seed;
  }
}

// A part that has images of a single place has no initial pair.
TEST_F(MapperStageTest, NoPartIsAStandstill) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildMapperWorld(WorldWithStop(160, 40.0, seed));
    Run(world);
    EXPECT_GT(summary_.plan.parts.size(), 1);
    for (const auto& part : summary_.parts) {
      EXPECT_TRUE(part.failure.empty())
          << "seed " << seed << ": " << part.failure;
    }
  }
}

TEST_F(MapperStageTest, StraightRoadIsReconstructed) {
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    MapperWorldOptions options;
    options.world.num_images = 60;
    options.world.seed = seed;
    options.world.trajectory = SyntheticTrajectory::kStraight;
    RunAndExpectBetterThanCoarse(options);
  }
}

TEST_F(MapperStageTest, FisheyeIsReconstructed) {
  MapperWorldOptions options;
  options.world.num_images = 50;
  options.world.camera_model = SyntheticCameraModel::kFisheye;
  RunAndExpectBetterThanCoarse(options);
}

// The priors constrain images without texture.
TEST_F(MapperStageTest, BlackoutIsBridgedByPriors) {
  MapperWorldOptions options;
  options.world.num_images = 100;
  options.world.num_blackouts = 1;
  options.world.blackout_num_images = 8;
  const MapperWorld world = BuildMapperWorld(options);
  const auto poses = Run(world);
  AlignmentOptions rigid;
  rigid.estimate_scale = false;
  const AlignedErrors errors =
      ComputeAlignedErrors(poses, world.true_poses, rigid);
  EXPECT_EQ(errors.num_images, options.world.num_images);
  EXPECT_LT(errors.rmse_m, PriorDriftM(options));
  EXPECT_LT(errors.rmse_m, 0.5 * CoarseRmseM(world));
}

// Only the priors constrain the images in the gaps. The model must not depend
// on the coarse poses, however wrong these are.
TEST_F(MapperStageTest, GapsDoNotDependOnTheCoarsePoses) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    MapperWorldOptions options = WorldWithGaps(seed);
    options.center_sigma_m = 0.1;
    const double expected_m =
        ComputeAlignedErrors(Run(BuildMapperWorld(options)),
                             BuildMapperWorld(options).true_poses, {})
            .rmse_m;
    std::filesystem::remove_all(folder_);
    options.center_sigma_m = 2.0;
    options.rotation_sigma_rad = 0.1;
    const MapperWorld world = BuildMapperWorld(options);
    const AlignedErrors errors =
        ComputeAlignedErrors(Run(world), world.true_poses, {});
    std::filesystem::remove_all(folder_);
    EXPECT_EQ(errors.num_images, options.world.num_images);
    // The same optimum, up to points that one of the two has found.
    EXPECT_LT(errors.rmse_m, 1.2 * expected_m) << "seed " << seed;
  }
}

// The order of summation must not decide where an adjustment converges, however
// far it starts from there.
TEST_F(MapperStageTest, ThreadsDoNotChangeTheResultOfBadCoarsePoses) {
  MapperWorldOptions options = WorldWithGaps(1);
  options.center_sigma_m = 2.0;
  options.rotation_sigma_rad = 0.1;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto expected = Run(world);
  options_.num_threads = 2;
  for (int run = 0; run < 10; ++run) {
    std::filesystem::remove_all(folder_);
    ExpectSamePoses(expected, Run(world));
  }
}

// Images that only a coarse pose constrains are deregistered: without priors,
// or with those of a gyroscope alone or of a speed alone.
TEST_F(MapperStageTest, ImagesThatNothingHoldsAreLeftOut) {
  const uint32_t kNoPriors = 0;
  for (const uint32_t flags :
       {kNoPriors, uint32_t{kPriorRotation}, uint32_t{kPriorLength}}) {
    for (uint64_t seed = 1; seed <= 2; ++seed) {
      std::filesystem::remove_all(folder_);
      MapperWorldOptions options;
      options.world.num_images = 60;
      options.world.seed = seed;
      options.world.num_blackouts = 1;
      options.world.blackout_num_images = 3;
      options.priors.enabled = flags != kNoPriors;
      MapperWorld world = BuildMapperWorld(options);
      for (RelativePosePrior& prior : world.data.priors) prior.flags = flags;
      const auto poses = Run(world);
      for (const auto& [image_id, image] : world.data.images) {
        EXPECT_EQ(poses.count(image_id), image.keypoints.empty() ? 0 : 1)
            << image.name;
      }
      EXPECT_EQ(summary_.refine.num_images_deregistered, 3);
    }
  }
}

TEST_F(MapperStageTest, ThreadsDoNotChangeTheResult) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto expected = Run(world);
  ASSERT_EQ(expected.size(), options.world.num_images);
  for (const int num_threads : {2, 4}) {
    std::filesystem::remove_all(folder_);
    options_.num_threads = num_threads;
    ExpectSamePoses(expected, Run(world));
  }
}

// COLMAP's mapper reports each image that it registers; users get our progress.
TEST_F(MapperStageTest, PrintsNothing) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  testing::internal::CaptureStdout();
  Run(BuildMapperWorld(options));
  std::cout.flush();
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
}

// Photos of an uncalibrated camera. They have no noise, as a drive mostly
// straight ahead observes the focal length only weakly.
TEST_F(MapperStageTest, UnknownFocalLengthIsRefined) {
  MapperWorldOptions options;
  options.world.num_images = 40;
  options.world.pixel_noise_px = 0.0;
  options.priors.enabled = false;
  MapperWorld world = BuildMapperWorld(options);
  colmap::Camera& camera = world.data.cameras.at(1);
  const double focal_px = camera.MeanFocalLength();
  camera.SetModelIdFromName("SIMPLE_PINHOLE");
  camera.SetParams(
      {1.02 * focal_px, 0.5 * camera.Width(), 0.5 * camera.Height()});
  const auto run = [&](bool refine_focal_length) {
    options_.refine.refine_focal_length = refine_focal_length;
    std::filesystem::remove_all(folder_);
    MapperStage stage(options_, world.data, world.coarse_poses, folder_);
    EXPECT_TRUE(stage.Plan().ok());
    EXPECT_TRUE(stage.RunAllParts().ok());
    const auto model = stage.Merge(true);
    EXPECT_TRUE(model.ok());
    return model->Camera(1).FocalLength() / focal_px;
  };
  EXPECT_EQ(run(false), 1.02);
  EXPECT_NEAR(run(true), 1.0, 0.005);
  options_.refine.constant_cameras = {1};
  EXPECT_EQ(run(true), 1.02);
}

// The ablations of the paper.
TEST_F(MapperStageTest, StepsCanBeSwitchedOff) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.align.adapt_threshold = false;
  options_.align.initial_threshold = 0.7;
  options_.local.registration.use_global_candidate = false;
  options_.local.use_priors_in_adjustment = false;
  EXPECT_EQ(Run(world).size(), options.world.num_images);
  for (const AlignSimilarityResult& alignment : summary_.aligned.alignments) {
    EXPECT_EQ(alignment.num_iterations, 1);
    EXPECT_EQ(alignment.threshold, 0.7);
  }
  for (const PartReport& part : summary_.parts) {
    EXPECT_EQ(part.num_registered_by_global_pose, 0);
  }
  EXPECT_EQ(summary_.refine.prior_chi2_per_dof, 0.0);
  std::filesystem::remove_all(folder_);
  options_.local.use_priors_in_adjustment = true;
  Run(world);
  EXPECT_GT(summary_.refine.prior_chi2_per_dof, 0.0);
}

TEST_F(MapperStageTest, SummaryIsJsonWithEveryPart) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  Run(BuildMapperWorld(options));
  const std::string json = MapperSummaryToJson(summary_).dump();
  EXPECT_NE(json.find("\"part_index\":1"), std::string::npos);
  EXPECT_NE(json.find("separator_rmse_after"), std::string::npos);
  EXPECT_NE(FormatMapperSummaryText(summary_).find("60 images"),
            std::string::npos);
  EXPECT_EQ(FormatMapperSummaryText(summary_).find("to save memory"),
            std::string::npos);
  summary_.refine.min_num_shared_points = 12;
  EXPECT_NE(FormatMapperSummaryText(summary_).find("fewer than 12 points"),
            std::string::npos);
}

TEST_F(MapperStageTest, WrongOptionsAreNamed) {
  std::string error;
  options_.local.keypoint_sigma_px = 0.0;
  EXPECT_FALSE(options_.IsValid(&error));
  EXPECT_EQ(error, "AdaSfmMapper.keypoint_sigma_px = 0 must be positive");
  EXPECT_THROW(MapperStage(options_, {}, {}, folder_), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
