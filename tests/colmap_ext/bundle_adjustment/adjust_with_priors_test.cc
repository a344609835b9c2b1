// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

TEST(AdjustBundleWithPriorsTest, PriorLengthsBringBackMetres) {
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

TEST(AdjustBundleWithPriorsTest, WeightsDoNotMoveANoiseFreeSolution) {
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
TEST(AdjustBundleWithPriorsTest, PriorsCarryImagesWithoutObservations) {
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
TEST(AdjustBundleWithPriorsTest, AStopInTheDarkKeepsTheChainTogether) {
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

TEST(AdjustBundleWithPriorsTest, PriorsAloneAreAPoseGraph) {
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

TEST(AdjustBundleWithPriorsTest, WrongPriorIsOutvoted) {
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

}  // namespace
}  // namespace adasfm
