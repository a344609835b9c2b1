// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"

#include <gtest/gtest.h>
#include <optim/bundle_adjustment.h>

#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

TEST(AdjustBundleTest, IsExactWithoutNoise) {
  for (const uint64_t seed : {1, 2, 3}) {
    BundleWorldOptions world;
    world.seed = seed;
    colmap::Reconstruction reconstruction = BuildBundleWorld(world);
    PerturbBundleWorld(5e-3, 0.1, seed, &reconstruction);
    const PriorBundleAdjustmentSummary summary = AdjustBundle(
        ConvergeFully(), ProblemOfAll(reconstruction), &reconstruction);
    ASSERT_TRUE(summary.success) << summary.message;
    EXPECT_LT(summary.final_cost, 1e-6 * summary.initial_cost);
    EXPECT_LT(AlignedCenterError(world, reconstruction), 1e-3);
  }
}

TEST(AdjustBundleTest, IsExactWithoutNoiseOnFisheye) {
  BundleWorldOptions world;
  world.camera_model = "OPENCV_FISHEYE";
  world.camera_params = {350, 350, 400, 250, 0.05, -0.01, 0.003, 0.0};
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  PerturbBundleWorld(5e-3, 0.1, 1, &reconstruction);
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), ProblemOfAll(reconstruction),
                           &reconstruction)
                  .success);
  EXPECT_LT(AlignedCenterError(world, reconstruction), 1e-3);
}

TEST(AdjustBundleTest, KeepsFirstPoseAndScaleWithoutLengths) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  PerturbBundleWorld(2e-3, 0.05, 1, &reconstruction);
  const auto center = [&](image_t id) {
    return CamFromWorld(reconstruction.Image(id)).TargetOriginInSource();
  };
  const Rigid3d first = CamFromWorld(reconstruction.Image(1));
  const double length = (center(20) - center(1)).norm();
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), ProblemOfAll(reconstruction),
                           &reconstruction)
                  .success);
  const Rigid3d after = CamFromWorld(reconstruction.Image(1));
  EXPECT_LT((after.translation - first.translation).norm(), 1e-12);
  EXPECT_LT(AngleBetweenRad(after.rotation, first.rotation), 1e-12);
  EXPECT_NEAR((center(20) - center(1)).norm(), length, 1e-3 * length);
}

TEST(AdjustBundleTest, AgreesWithColmap) {
  for (const uint64_t seed : {1, 2, 3}) {
    BundleWorldOptions world;
    world.seed = seed;
    world.pixel_noise_px = 0.5;
    colmap::Reconstruction ours = BuildBundleWorld(world);
    PerturbBundleWorld(2e-3, 0.05, seed, &ours);
    colmap::Reconstruction theirs = ours;

    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.reproj_loss_scale_px = 0.0;
    options.keypoint_sigma_px = 1.0;  // COLMAP's cost is in px
    const PriorBundleAdjustmentSummary summary =
        AdjustBundle(options, ProblemOfAll(ours), &ours);
    ASSERT_TRUE(summary.success);

    colmap::BundleAdjustmentConfig config;
    for (const image_t id : theirs.RegImageIds()) config.AddImage(id);
    config.SetConstantPose(1);
    config.SetConstantTvec(world.num_images, {0});
    config.SetConstantCamera(1);
    colmap::BundleAdjustmentOptions colmap_options;
    colmap_options.print_summary = false;
    colmap::BundleAdjuster adjuster(colmap_options, config);
    ASSERT_TRUE(adjuster.Solve(&theirs));

    const double cost = adjuster.Summary().final_cost;
    EXPECT_NEAR(summary.final_cost, cost, 1e-3 * cost);
    EXPECT_NEAR(AlignedCenterError(world, ours),
                AlignedCenterError(world, theirs), 2e-3);
  }
}

// One focal length: a camera that only yaws cannot distinguish a wrong vertical
// focal length from a taller world.
TEST(AdjustBundleTest, RefinesTheFocalLength) {
  BundleWorldOptions world;
  world.camera_model = "SIMPLE_PINHOLE";
  world.camera_params = {480, 400, 250};
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  reconstruction.Camera(1).SetParams({470, 400, 250});
  PriorBundleAdjustmentOptions options = ConvergeFully();
  options.refine_focal_length = true;
  ASSERT_TRUE(
      AdjustBundle(options, ProblemOfAll(reconstruction), &reconstruction)
          .success);
  EXPECT_NEAR(reconstruction.Camera(1).Params(0), 480.0, 0.5);
  EXPECT_EQ(reconstruction.Camera(1).Params(1), 400.0);
}

TEST(AdjustBundleTest, ConstantCamerasKeepTheirLens) {
  BundleWorldOptions world;
  world.camera_model = "SIMPLE_RADIAL";
  world.camera_params = {480, 400, 250, 0.05};
  world.pixel_noise_px = world.second_camera_noise_px = 0.01;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  reconstruction.Camera(2).SetParams({470, 400, 250, 0.0});
  PriorBundleAdjustmentOptions options = ConvergeFully();
  options.refine_focal_length = options.refine_extra_params = true;
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.constant_cameras = {1};
  ASSERT_TRUE(AdjustBundle(options, problem, &reconstruction).success);
  EXPECT_EQ(reconstruction.Camera(1).Params(), world.camera_params);
  EXPECT_NEAR(reconstruction.Camera(2).Params(0), 480.0, 0.5);
  EXPECT_NEAR(reconstruction.Camera(2).Params(3), 0.05, 0.001);
}

TEST(AdjustBundleTest, ConstantImagesDoNotMove) {
  BundleWorldOptions world;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  PerturbBundleWorld(0.0, 0.05, 1, &reconstruction);
  for (const image_t id : reconstruction.RegImageIds()) {
    if (id == 10) continue;
    SetCamFromWorld(BundleWorldPose(world, id - 1), &reconstruction.Image(id));
  }
  const colmap::Reconstruction before = reconstruction;
  PriorBundleAdjustmentProblem problem;
  problem.images = {10};
  problem.constant_images = {7, 8, 9, 11, 12, 13};
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), problem, &reconstruction).success);
  for (const image_t id : reconstruction.RegImageIds()) {
    if (id == 10) continue;
    EXPECT_EQ(reconstruction.Image(id).Qvec(), before.Image(id).Qvec());
    EXPECT_EQ(reconstruction.Image(id).Tvec(), before.Image(id).Tvec());
  }
  EXPECT_LT(CenterError(world, reconstruction), 1e-3);
}

TEST(AdjustBundleTest, LeavesPointsBehindCamerasOut) {
  BundleWorldOptions world;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  const Eigen::Vector3d behind(-1000.0, 0.0, 0.0);
  reconstruction.Point3D(1).SetXYZ(behind);
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), ProblemOfAll(reconstruction),
                           &reconstruction)
                  .success);
  EXPECT_EQ(reconstruction.Point3D(1).XYZ(), behind);
  EXPECT_LT(CenterError(world, reconstruction), 1e-3);
}

TEST(AdjustBundleTest, FailsWithoutResidualsAndChangesNothing) {
  BundleWorldOptions world;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  PriorBundleAdjustmentProblem problem;
  problem.images = {1};
  const PriorBundleAdjustmentSummary summary =
      AdjustBundle(PriorBundleAdjustmentOptions(), problem, &reconstruction);
  EXPECT_FALSE(summary.success);
  EXPECT_FALSE(summary.message.empty());
  EXPECT_LT(CenterError(world, reconstruction), 1e-12);
}

// A slight bend of a whole street changes the cost by little compared with the
// keypoint noise. The adjustment still reaches the optimum that an adjustment
// from the truth reaches.
TEST(AdjustBundleTest, UnbendsALongStreet) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    BundleWorldOptions world;
    world.num_images = 1200;
    world.num_keypoints_per_image = 40;
    world.pixel_noise_px = 0.5;
    world.seed = seed;
    colmap::Reconstruction from_truth = BuildBundleWorld(world);
    AdjustBundle(ConvergeFully(), ProblemOfAll(from_truth), &from_truth);
    colmap::Reconstruction from_bend = BuildBundleWorld(world);
    Bend(/*radius_m=*/16000.0, &from_bend);
    PriorBundleAdjustmentOptions options;
    options.max_num_iterations = 25;
    options.function_tolerance = 1e-6;
    AdjustBundle(options, ProblemOfAll(from_bend), &from_bend);
    const double truth_m = AlignedCenterError(world, from_truth);
    EXPECT_NEAR(AlignedCenterError(world, from_bend), truth_m, 0.01 * truth_m)
        << "seed " << seed;
  }
}

TEST(PriorBundleAdjustmentOptionsTest, NamesTheBrokenRule) {
  PriorBundleAdjustmentOptions options;
  std::string error;
  EXPECT_TRUE(options.IsValid(&error));
  options.keypoint_sigma_px = 0.0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("keypoint_sigma_px"), std::string::npos);
  colmap::Reconstruction reconstruction;
  EXPECT_THROW(
      AdjustBundle(options, PriorBundleAdjustmentProblem(), &reconstruction),
      std::invalid_argument);
}

// With wrong matches one image of a pair may see all points twice and the other
// image none. The first image is constant and the other has no residual.
TEST(AdjustBundleTest, WithoutAFreePoseNothingMoves) {
  colmap::Reconstruction world = BuildBundleWorld({});
  const auto ids = world.Point3DIds();
  for (const auto id : std::set<colmap::point3D_t>(ids.begin(), ids.end())) {
    world.DeletePoint3D(id);
  }
  const Rigid3d world_from_cam = CamFromWorld(world.Image(1)).Inverse();
  for (int k = 0; k < 10; ++k) {
    colmap::Track track;
    track.AddElement(1, 2 * k);
    track.AddElement(1, 2 * k + 1);
    world.AddPoint3D(world_from_cam * Eigen::Vector3d(0.1 * k, 0.0, 10.0),
                     track);
  }
  PriorBundleAdjustmentProblem problem;
  problem.images = {1, 2};
  const PriorBundleAdjustmentSummary summary =
      AdjustBundle({}, problem, &world);
  EXPECT_GT(summary.num_residuals, 0);
  EXPECT_EQ(summary.message, "no pose is free");
}

}  // namespace
}  // namespace adasfm
