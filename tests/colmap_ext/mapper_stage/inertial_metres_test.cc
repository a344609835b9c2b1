// SPDX-License-Identifier: BSD-3-Clause
// The metres of a model that an accelerometer tells.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <vector>

#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "core/inertial_motion.h"
#include "core/random.h"
#include "tests/testing/colmap_ext/mapper_drive.h"
#include "tests/testing/colmap_ext/mapper_stage_fixture.h"

namespace adasfm {
namespace {

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

}  // namespace
}  // namespace adasfm
