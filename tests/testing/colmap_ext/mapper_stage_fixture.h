// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "tests/testing/colmap_ext/mapper_world.h"
#include "tests/testing/colmap_ext/temporary_folder.h"
#include "tests/testing/matchers.h"

namespace adasfm {

// Runs the mapper stage in a folder of its own, on worlds of several parts.
class MapperStageTest : public testing::Test {
 protected:
  void SetUp() override {
    // Small parts, so that small worlds have several.
    options_.partition.max_num_images_undivided = 40;
    options_.partition.cut.max_part_size = 40;
    options_.num_threads = 2;
  }

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

  // All images, at less than half of the coarse error.
  void RunAndExpectBetterThanCoarse(const MapperWorldOptions& options) {
    const MapperWorld world = BuildMapperWorld(options);
    const AlignedErrors errors =
        ComputeAlignedErrors(Run(world), world.true_poses, {});
    EXPECT_EQ(errors.num_images, options.world.num_images);
    EXPECT_LT(errors.rmse_m, 0.5 * CoarseRmseM(world));
  }

  // Another order of sums makes an adjustment converge elsewhere within its
  // tolerance: far below what 0.5 px leave open.
  static void ExpectSamePoses(const std::map<image_t, Rigid3d>& expected,
                              const std::map<image_t, Rigid3d>& poses) {
    ASSERT_EQ(poses.size(), expected.size());
    for (const auto& [image_id, pose] : expected) {
      EXPECT_TRUE(PosesNear(pose, poses.at(image_id), 1e-3, 1e-2));
    }
  }

  // Two gaps that only the priors of a good gyroscope and good wheels bridge.
  static MapperWorldOptions WorldWithGaps(uint64_t seed) {
    MapperWorldOptions options;
    options.world.num_images = 100;
    options.world.seed = seed;
    options.world.num_blackouts = 2;
    options.world.blackout_num_images = 16;
    options.priors.rotation_sigma_rad = 0.0005;
    options.priors.translation_sigma_m = 0.005;
    return options;
  }

  static double CoarseRmseM(const MapperWorld& world) {
    return ComputeAlignedErrors(world.coarse_poses, world.true_poses, {})
        .rmse_m;
  }

  MapperStageOptions options_;
  MapperStageSummary summary_;
  const TemporaryFolder temporary_;
  // A folder that a test may remove and make again.
  const std::string folder_ = temporary_.File("mapper");
};

}  // namespace adasfm
