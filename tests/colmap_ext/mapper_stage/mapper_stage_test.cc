// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/mapper_stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "colmap_ext/mapper_stage/mapping_summary.h"
#include "core/inertial_motion.h"
#include "core/random.h"
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

// The lengths of the priors' motions in a model, as the coarse stage states
// them (colmap_ext/coarse/measure_size.h).
std::vector<InertialLength> LengthsOf(
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::vector<RelativePosePrior>& priors) {
  std::vector<InertialLength> lengths;
  double sum = 0.0;
  for (const RelativePosePrior& prior : priors) {
    const double length_m =
        ComputeCam2FromCam1(cams_from_world.at(prior.image_id1),
                            cams_from_world.at(prior.image_id2))
            .translation.norm();
    lengths.push_back({prior.image_id1, prior.image_id2, length_m, 0.0, 0.01});
    sum += length_m * length_m;
  }
  for (InertialLength& length : lengths) length.sigma_m = std::sqrt(sum);
  return lengths;
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

// The priors keep their rotations and get the lengths of the coarse model, as
// if an accelerometer had determined its metres.
void LeaveToAnImu(MapperWorld* world) {
  for (RelativePosePrior& prior : world->data.priors) {
    prior.flags = kPriorRotation;
  }
  AddInertialLengths(LengthsOf(world->coarse_poses, world->data.priors),
                     &world->data.priors);
}

// An IMU without wheels: images on few points with wrong coarse positions do
// not change the scale that the accelerometer determined.
TEST_F(MapperStageTest, WrongPlacesLeaveTheUnitOfTheAccelerometer) {
  for (const uint64_t seed : {1, 2, 3}) {
    MapperWorldOptions options;
    options.world.num_images = 100;
    options.world.seed = seed;
    options.world.num_blackouts = 1;
    options.world.blackout_num_images = 6;
    options.world.blackout_num_keypoints = 14;
    options.center_sigma_m = 0.02;
    MapperWorld world = BuildMapperWorld(options);
    Random random(seed);
    for (auto& [image_id, pose] : world.coarse_poses) {
      if (world.data.images.at(image_id).keypoints.size() > 20) continue;
      pose.translation += random.GaussianVector(10.0);
    }
    world.data.inertial_scale_sigma = 0.01;
    LeaveToAnImu(&world);
    std::filesystem::remove_all(folder_);
    const AlignedErrors errors =
        ComputeAlignedErrors(Run(world), world.true_poses, {});
    EXPECT_GE(errors.num_images, 94);
    EXPECT_NEAR(errors.scale, 1.0, 0.01);
  }
}

// Coarse poses 0.02 m off, and an IMU with white noise of 0.005 m/s^2 sqrt(s).
MapperWorld BuildInertialDrive(uint64_t seed, int num_blackouts = 0) {
  MapperWorldOptions options;
  options.world.num_images = 100;
  options.world.seed = seed;
  options.world.num_blackouts = num_blackouts;
  options.world.blackout_num_images = 2;
  options.center_sigma_m = 0.02;
  MapperWorld world = BuildMapperWorld(options);
  InertialDriveOptions drive;
  drive.noise = 0.005;
  drive.seed = seed;
  world.data.inertial_motions = IntegrateDrive(world, drive);
  return world;
}

// An IMU without wheels: the coarse model is 2 % too large, and the final one
// is within 3 sigmas of the truth. The sigma includes 0.2 % that no residual
// shows. Noise of 0.005 m/s^2 sqrt(s) displaces a second by 0.003 m, while the
// drive changes its speed by 1 m/s.
TEST_F(MapperStageTest, TheAccelerometerTellsTheSizeOfTheFinalModel) {
  for (const uint64_t seed : {1, 2, 3}) {
    MapperWorld world = BuildInertialDrive(seed);
    world.data.inertial_scale_sigma = 0.02;
    for (auto& [image_id, pose] : world.coarse_poses) pose.translation *= 1.02;
    LeaveToAnImu(&world);
    std::filesystem::remove_all(folder_);
    const AlignedErrors errors =
        ComputeAlignedErrors(Run(world), world.true_poses, {});
    EXPECT_EQ(errors.num_images, 100);
    EXPECT_LT(summary_.scale_sigma, 0.004) << "seed " << seed;
    EXPECT_NEAR(errors.scale, 1.0, 3.0 * summary_.scale_sigma)
        << "seed " << seed;
  }
}

// Images without points in a drive with an IMU alone: the factors over three
// images constrain them. Noise of 0.005 m/s^2 sqrt(s) displaces the half second
// of two images by some millimetres, as an alignment with two more images on
// either side shows.
TEST_F(MapperStageTest, TheAccelerometerHoldsImagesWithoutPoints) {
  for (const uint64_t seed : {1, 2, 3}) {
    MapperWorld world = BuildInertialDrive(seed, 1);
    world.data.inertial_scale_sigma = 0.02;
    LeaveToAnImu(&world);
    std::filesystem::remove_all(folder_);
    const std::map<image_t, Rigid3d> poses = Run(world);
    EXPECT_EQ(poses.size(), 100) << "seed " << seed;
    std::map<image_t, Rigid3d> around;
    for (const auto& [image_id, image] : world.data.images) {
      if (!image.keypoints.empty()) continue;
      for (image_t near = image_id - 2; near <= image_id + 2; ++near) {
        if (poses.count(near)) around.emplace(near, poses.at(near));
      }
    }
    ASSERT_EQ(around.size(), 6) << "seed " << seed;
    EXPECT_LT(ComputeAlignedErrors(around, world.true_poses, {}).max_m, 0.02)
        << "seed " << seed;
  }
}

// The importer has wrongly scaled the wheels' lengths by kScale.
class WheelScaleTest : public MapperStageTest {
 protected:
  static constexpr double kScale = 1.02;

  // `sigma` is the importer's 1 sigma of the scale.
  static MapperWorld Build(uint64_t seed, double sigma) {
    MapperWorld world = BuildInertialDrive(seed);
    for (auto& [image_id, pose] : world.coarse_poses) {
      pose.translation *= kScale;
    }
    for (size_t i = 0; i < world.data.priors.size(); ++i) {
      RelativePosePrior& prior = world.data.priors[i];
      prior.cam2_from_cam1.translation *= kScale;
      world.data.inertial_motions[i].by_wheels =
          MeasuredTranslation{prior.cam2_from_cam1.translation,
                              prior.covariance.bottomRightCorner<3, 3>()};
    }
    world.data.wheel_scale = WheelScale{kScale, sigma, 0.01};
    return world;
  }

  // The size of the model over the true size.
  double RunSize(const MapperWorld& world) {
    std::filesystem::remove_all(folder_);
    return 1.0 / ComputeAlignedErrors(Run(world), world.true_poses, {}).scale;
  }
};

// The final sigma is that of the accelerometer on the final shape.
TEST_F(WheelScaleTest, TheAccelerometerCorrectsIt) {
  for (const uint64_t seed : {1, 2, 3}) {
    const double size = RunSize(Build(seed, 0.007));
    EXPECT_LT(summary_.scale_sigma, 0.004) << "seed " << seed;
    EXPECT_NEAR(size, 1.0, 3.0 * summary_.scale_sigma) << "seed " << seed;
    EXPECT_NEAR(summary_.size_over_priors, 1.0 / kScale, 0.004);
  }
}

TEST_F(WheelScaleTest, StaysWhereItIsKnownBetter) {
  EXPECT_NEAR(RunSize(Build(1, 0.0005)), kScale, 0.002);
  EXPECT_NEAR(summary_.scale_sigma, 0.0005 / kScale, 1e-12);
}

// The coarse stage did not use the wheels, and the step at a slip has the
// accelerometer's length. The wheels determine the final scale nevertheless.
TEST_F(WheelScaleTest, DoesNotFollowTheCoarseModel) {
  MapperWorld world = Build(1, 0.0005);
  world.data.inertial_scale_sigma = 0.02;
  RelativePosePrior& slip = world.data.priors[50];
  slip.flags = kPriorRotation | kPriorLength | kPriorInertialLength;
  slip.cam2_from_cam1.translation *= 1.05;
  world.data.inertial_motions[50].by_wheels.reset();
  EXPECT_NEAR(RunSize(world), kScale, 0.002);
  EXPECT_NEAR(summary_.scale_sigma, 0.0005 / kScale, 1e-12);
  EXPECT_EQ(summary_.size_over_priors, 1.0);
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
  options_.local.global_adjustment_growth = 1.0;
  EXPECT_FALSE(options_.IsValid(&error));
  EXPECT_EQ(error, "AdaSfmMapper.global_adjustment_growth = 1 must be above 1");
  EXPECT_THROW(MapperStage(options_, {}, {}, folder_), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
