// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "colmap_ext/host/pose_conversion.h"
#include "tests/colmap_ext/mapper_world.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

class MapperStageTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = (fs::temp_directory_path() /
               (std::string("adasfm_mapper_") + info->name()))
                  .string();
    fs::remove_all(folder_);
    // Small parts, so that small worlds have several.
    options_.partition.max_num_images_undivided = 40;
    options_.partition.cut.max_part_size = 40;
    options_.num_threads = 2;
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Plan, parts and merge in the test's folder.
  std::map<image_t, Rigid3d> Run(const MapperWorld& world) {
    MapperStage stage(options_, world.data, world.coarse_poses, folder_);
    EXPECT_TRUE(stage.Plan().ok());
    EXPECT_TRUE(stage.RunAllParts().ok());
    const auto model = stage.Merge(true);
    EXPECT_TRUE(model.ok()) << model.status().message();
    summary_ = stage.Summary();
    return model.ok() ? Poses(*model) : std::map<image_t, Rigid3d>();
  }

  static std::map<image_t, Rigid3d> Poses(
      const colmap::Reconstruction& reconstruction) {
    std::map<image_t, Rigid3d> poses;
    for (const image_t image_id : reconstruction.RegImageIds()) {
      poses[image_id] = CamFromWorld(reconstruction.Image(image_id));
    }
    return poses;
  }

  MapperStageOptions options_;
  MapperStageSummary summary_;
  std::string folder_;
};

// What a chain of num_images priors gathers between its ends when vision adds
// nothing: an upper bound of the error that the tests allow.
double PriorDriftM(const MapperWorldOptions& options) {
  const int n = options.world.num_images;
  const double length_m = n * options.world.spacing_m;
  return options.priors.translation_sigma_m * std::sqrt(1.0 * n) +
         options.priors.rotation_sigma_rad * std::sqrt(1.0 * n) * length_m /
             std::sqrt(3.0);
}

double CoarseRmseM(const MapperWorld& world) {
  return ComputeAlignedErrors(world.coarse_poses, world.true_poses, {}).rmse_m;
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
  const MapperWorld world = BuildMapperWorld(options);
  const auto poses = Run(world);
  EXPECT_FALSE(summary_.is_metric);
  EXPECT_FALSE(summary_.is_level);
  const AlignedErrors errors =
      ComputeAlignedErrors(poses, world.true_poses, {});
  EXPECT_EQ(errors.num_images, options.world.num_images);
  EXPECT_LT(errors.rmse_m, 0.5 * CoarseRmseM(world));
}

TEST_F(MapperStageTest, StraightRoadIsReconstructed) {
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    MapperWorldOptions options;
    options.world.num_images = 60;
    options.world.seed = seed;
    options.world.trajectory = SyntheticTrajectory::kStraight;
    const MapperWorld world = BuildMapperWorld(options);
    const auto poses = Run(world);
    const AlignedErrors errors =
        ComputeAlignedErrors(poses, world.true_poses, {});
    EXPECT_EQ(errors.num_images, options.world.num_images);
    EXPECT_LT(errors.rmse_m, 0.5 * CoarseRmseM(world));
  }
}

TEST_F(MapperStageTest, FisheyeIsReconstructed) {
  MapperWorldOptions options;
  options.world.num_images = 50;
  options.world.camera_model = SyntheticCameraModel::kFisheye;
  const MapperWorld world = BuildMapperWorld(options);
  const auto poses = Run(world);
  const AlignedErrors errors =
      ComputeAlignedErrors(poses, world.true_poses, {});
  EXPECT_EQ(errors.num_images, options.world.num_images);
  EXPECT_LT(errors.rmse_m, 0.5 * CoarseRmseM(world));
}

// Images without texture are held by the priors between them.
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

TEST_F(MapperStageTest, ThreadsDoNotChangeTheImages) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto poses1 = Run(world);
  fs::remove_all(folder_);
  options_.num_threads = 2;
  const auto poses2 = Run(world);
  ASSERT_EQ(poses1.size(), poses2.size());
  for (const auto& [image_id, pose] : poses1) {
    // Sums in another order end the adjustment elsewhere within its tolerance.
    EXPECT_TRUE(PosesNear(pose, poses2.at(image_id), 1e-3, 1e-2));
  }
}

TEST_F(MapperStageTest, ContinuesFromWhatIsThere) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto undisturbed = Run(world);
  // As a kill in the middle of part 0 leaves it: its temporary folder, and no
  // part.
  const std::string part = folder_ + "/checkpoints/part_0";
  fs::rename(part, part + ".tmp");
  fs::remove(part + ".tmp/points3D.bin");
  const auto part_time = fs::last_write_time(folder_ + "/checkpoints/part_1");
  const auto continued = Run(world);
  EXPECT_EQ(part_time, fs::last_write_time(folder_ + "/checkpoints/part_1"));
  ASSERT_EQ(undisturbed.size(), continued.size());
  for (const auto& [image_id, pose] : undisturbed) {
    EXPECT_TRUE(PosesNear(pose, continued.at(image_id), 1e-9, 1e-9));
  }
}

TEST_F(MapperStageTest, ChangedOptionsOrDataStartAnew) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  MapperWorld world = BuildMapperWorld(options);
  MapperStage stage(options_, world.data, world.coarse_poses, folder_);
  ASSERT_TRUE(stage.Plan().ok());
  ASSERT_TRUE(stage.RunPart(0).ok());
  const std::string part = folder_ + "/checkpoints/part_0/part.json";
  ASSERT_TRUE(fs::exists(part));

  MapperStageOptions changed = options_;
  changed.local.registration.max_reproj_error_px = 6.0;
  MapperStage with_options(changed, world.data, world.coarse_poses, folder_);
  EXPECT_NE(with_options.Fingerprint(), stage.Fingerprint());
  EXPECT_FALSE(with_options.RunPart(0).ok());
  EXPECT_FALSE(with_options.Merge(true).ok());

  world.data.images.begin()->second.keypoints.front().x() += 1.0;
  MapperStage with_data(options_, world.data, world.coarse_poses, folder_);
  EXPECT_NE(with_data.Fingerprint(), stage.Fingerprint());
  ASSERT_TRUE(with_data.Plan().ok());
  EXPECT_FALSE(fs::exists(part));
}

TEST_F(MapperStageTest, MergeNamesTheMissingParts) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  MapperStage stage(options_, world.data, world.coarse_poses, folder_);
  EXPECT_FALSE(stage.RunPart(0).ok());
  ASSERT_TRUE(stage.Plan().ok());
  ASSERT_TRUE(stage.RunPart(0).ok());
  EXPECT_FALSE(stage.RunPart(99).ok());
  const auto missing = stage.Merge(true);
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.status().message().find("missing parts: 1"),
            std::string::npos);
  // What is there can be merged all the same; the rest keeps coarse poses.
  MapperStage again(options_, world.data, world.coarse_poses, folder_);
  const auto model = again.Merge(false);
  ASSERT_TRUE(model.ok());
  EXPECT_EQ(model->NumRegImages(), options.world.num_images);
}

TEST_F(MapperStageTest, SummaryIsJsonWithEveryPart) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  Run(BuildMapperWorld(options));
  const std::string json = FormatMapperSummaryJson(summary_);
  EXPECT_NE(json.find("\"part_index\": 1"), std::string::npos);
  EXPECT_NE(json.find("separator_rmse_after"), std::string::npos);
  EXPECT_NE(FormatMapperSummaryText(summary_).find("60 images"),
            std::string::npos);
}

TEST_F(MapperStageTest, WrongOptionsAreNamed) {
  std::string error;
  options_.local.global_adjustment_growth = 1.0;
  EXPECT_FALSE(options_.IsValid(&error));
  EXPECT_NE(error.find("global_adjustment_growth = 1.0"), std::string::npos);
  EXPECT_THROW(MapperStage(options_, {}, {}, folder_), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
