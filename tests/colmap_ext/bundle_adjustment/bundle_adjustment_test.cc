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

TEST(AdjustBundleTest, PriorLengthsBringBackMetres) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  // The whole world 20 % too large.
  for (const image_t id : reconstruction.RegImageIds()) {
    reconstruction.Image(id).Tvec() *= 1.2;
  }
  for (colmap::point3D_t id = 1; id <= reconstruction.NumPoints3D(); ++id) {
    reconstruction.Point3D(id).XYZ() *= 1.2;
  }
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.priors = TruePriors(world);
  PriorBundleAdjustmentOptions options = ConvergeFully();
  options.prior_loss_scale = 100.0;
  ASSERT_TRUE(AdjustBundle(options, problem, &reconstruction).success);
  double scale = 0.0;
  AlignedCenterError(world, reconstruction, &scale);
  EXPECT_NEAR(scale, 1.0, 0.005);
}

TEST(AdjustBundleTest, WeightsDoNotMoveANoiseFreeSolution) {
  BundleWorldOptions world;
  for (const double sigma_factor : {0.1, 1.0, 100.0}) {
    colmap::Reconstruction reconstruction = BuildBundleWorld(world);
    PerturbBundleWorld(2e-3, 0.05, 1, &reconstruction);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
    problem.priors = TruePriors(world);
    for (PosePriorEdge& edge : problem.priors) {
      edge.rotation_sigma_rad *= sigma_factor;
      edge.direction_sigma_rad *= sigma_factor;
      edge.length_sigma_m *= sigma_factor;
    }
    ASSERT_TRUE(
        AdjustBundle(ConvergeFully(), problem, &reconstruction).success);
    EXPECT_LT(CenterError(world, reconstruction), 2e-3) << sigma_factor;
  }
}

// Images 8 to 13 have no observations: only priors connect them.
//
//   1 - ... - 7 ~ 8 ~ 9 ~ ... ~ 13 ~ 14 - ... - 20      (~ prior only)
TEST(AdjustBundleTest, PriorsCarryImagesWithoutObservations) {
  BundleWorldOptions world;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  for (image_t id = 8; id <= 13; ++id) {
    const size_t num_points2D = reconstruction.Image(id).NumPoints2D();
    for (size_t idx = 0; idx < num_points2D; ++idx) {
      if (reconstruction.Image(id).Point2D(idx).HasPoint3D()) {
        reconstruction.DeleteObservation(id, idx);
      }
    }
  }
  PerturbBundleWorld(2e-3, 0.05, 1, &reconstruction);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.priors = TruePriors(world);
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), problem, &reconstruction).success);
  EXPECT_LT(CenterError(world, reconstruction), 2e-3);
}

// The vehicle stops while the camera sees nothing: images 8 to 13 have no
// observations, and images 10 to 12 are at one place, up to a millimetre.
TEST(AdjustBundleTest, AStopInTheDarkKeepsTheChainTogether) {
  const double sigma_m = 3e-3;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    BundleWorldOptions world;
    world.seed = seed;
    colmap::Reconstruction reconstruction = BuildBundleWorld(world);
    Random random(seed);
    std::map<image_t, Rigid3d> truth;
    for (const image_t id : reconstruction.RegImageIds()) {
      truth[id] = CamFromWorld(reconstruction.Image(id));
      if (id < 8 || id > 13) continue;
      for (size_t k = 0; k < reconstruction.Image(id).NumPoints2D(); ++k) {
        if (reconstruction.Image(id).Point2D(k).HasPoint3D()) {
          reconstruction.DeleteObservation(id, k);
        }
      }
    }
    for (const image_t id : {11, 12}) {
      truth[id] = CamFromWorldWithCenter(
          truth.at(10).rotation,
          truth.at(10).TargetOriginInSource() + random.GaussianVector(1e-3));
      SetCamFromWorld(truth.at(id), &reconstruction.Image(id));
    }
    PerturbBundleWorld(2e-3, 0.05, seed, &reconstruction);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
    for (const image_t id : reconstruction.RegImageIds()) {
      if (truth.count(id + 1) == 0) continue;
      RelativePosePrior prior;
      prior.image_id1 = id;
      prior.image_id2 = id + 1;
      prior.cam2_from_cam1 =
          ComputeCam2FromCam1(truth.at(id), truth.at(id + 1));
      prior.cam2_from_cam1.translation += random.GaussianVector(sigma_m);
      prior.covariance.setZero();
      prior.covariance.diagonal() << Eigen::Vector3d::Constant(1e-8),
          Eigen::Vector3d::Constant(sigma_m * sigma_m);
      prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
      problem.priors.push_back(PosePriorEdgeFromPrior(prior));
    }
    ASSERT_TRUE(
        AdjustBundle(PriorBundleAdjustmentOptions(), problem, &reconstruction)
            .success);
    for (const auto& [id, pose] : truth) {
      // 5 sigmas of six steps with three components each.
      EXPECT_LT((CamFromWorld(reconstruction.Image(id)).TargetOriginInSource() -
                 pose.TargetOriginInSource())
                    .norm(),
                5.0 * std::sqrt(18.0) * sigma_m)
          << "seed " << seed << ", image " << id;
    }
  }
}

TEST(AdjustBundleTest, PriorsAloneAreAPoseGraph) {
  BundleWorldOptions world;
  world.num_keypoints_per_image = 0;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  ASSERT_EQ(reconstruction.NumPoints3D(), 0);
  PerturbBundleWorld(2e-3, 0.05, 1, &reconstruction);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.priors = TruePriors(world);
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), problem, &reconstruction).success);
  EXPECT_LT(CenterError(world, reconstruction), 1e-4);
}

TEST(AdjustBundleTest, WrongPriorIsOutvoted) {
  BundleWorldOptions world;
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.priors = TruePriors(world);
  // A length as of a slipping wheel, and a rotation that did not happen.
  problem.priors[9].cam2_from_cam1.translation *= 3.0;
  problem.priors[9].cam2_from_cam1.rotation =
      ExpSo3(Eigen::Vector3d(0.0, 0.3, 0.0)) *
      problem.priors[9].cam2_from_cam1.rotation;
  ASSERT_TRUE(AdjustBundle(ConvergeFully(), problem, &reconstruction).success);
  EXPECT_LT(CenterError(world, reconstruction), 0.05);
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

TEST(AdjustBundleTest, EverySizeOfSolverGivesTheSame) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  std::vector<double> costs;
  for (const auto& [dense, sparse] : {std::pair(50, 4000), std::pair(0, 0)}) {
    colmap::Reconstruction reconstruction = BuildBundleWorld(world);
    PerturbBundleWorld(2e-3, 0.05, 1, &reconstruction);
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.max_num_images_dense = dense;
    options.max_num_images_sparse = sparse;
    costs.push_back(
        AdjustBundle(options, ProblemOfAll(reconstruction), &reconstruction)
            .final_cost);
  }
  EXPECT_NEAR(costs[1], costs[0], 1e-2 * costs[0]);
}

TEST(AdjustBundleTest, ThreadsChangeNothing) {
  BundleWorldOptions world;
  world.num_images = 100;
  world.num_keypoints_per_image = 150;
  world.pixel_noise_px = 0.5;
  std::vector<colmap::Reconstruction> results;
  for (const int num_threads : {1, 2, 5}) {
    results.push_back(BuildBundleWorld(world));
    PerturbBundleWorld(2e-3, 0.05, 1, &results.back());
    PriorBundleAdjustmentOptions options;
    options.num_threads = num_threads;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundle(options, ProblemOfAll(results.back()), &results.back());
    ASSERT_TRUE(summary.success);
    // Enough for threads to be used.
    ASSERT_GT(summary.num_residuals, 20000);
    ASSERT_GT(summary.num_iterations, 1);
  }
  for (const image_t id : results[0].RegImageIds()) {
    for (const size_t k : {1, 2}) {
      EXPECT_EQ(results[k].Image(id).Qvec(), results[0].Image(id).Qvec());
      EXPECT_EQ(results[k].Image(id).Tvec(), results[0].Image(id).Tvec());
    }
  }
  for (const auto& [point_id, point] : results[0].Points3D()) {
    for (const size_t k : {1, 2}) {
      EXPECT_EQ(results[k].Point3D(point_id).XYZ(), point.XYZ());
    }
  }
}

// If the equations exceed max_memory_gb, points are cut, which hardly changes
// the poses; otherwise the result is identical.
TEST(AdjustBundleTest, CutsPointsWhereMemoryIsBounded) {
  for (const uint64_t seed : {1, 2, 3}) {
    BundleWorldOptions world;
    world.num_images = 100;
    world.num_keypoints_per_image = 300;
    world.pixel_noise_px = 0.5;
    world.seed = seed;
    std::vector<colmap::Reconstruction> models;
    std::vector<int> num_points;
    std::vector<int> min_num_shared_points;
    for (const double max_memory_gb : {-1.0, 1000.0, 1e-3}) {
      models.push_back(BuildBundleWorld(world));
      PerturbBundleWorld(2e-3, 0.05, seed, &models.back());
      PriorBundleAdjustmentProblem problem = ProblemOfAll(models.back());
      problem.priors = TruePriors(world);
      PriorBundleAdjustmentOptions options = ConvergeFully();
      options.max_memory_gb = max_memory_gb;
      const PriorBundleAdjustmentSummary summary =
          AdjustBundle(options, problem, &models.back());
      EXPECT_TRUE(summary.success);
      num_points.push_back(summary.num_points);
      min_num_shared_points.push_back(summary.min_num_shared_points);
    }
    EXPECT_EQ(min_num_shared_points, (std::vector<int>{1, 1, 48}));
    EXPECT_EQ(num_points[1], num_points[0]);
    EXPECT_GT(num_points[2], num_points[0]);
    for (const image_t id : models[0].RegImageIds()) {
      EXPECT_EQ(models[1].Image(id).Tvec(), models[0].Image(id).Tvec());
    }
    // The error that cutting adds is smaller than the error due to the noise.
    EXPECT_LT(CenterError(world, models[2]),
              std::sqrt(2.0) * CenterError(world, models[0]));
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
