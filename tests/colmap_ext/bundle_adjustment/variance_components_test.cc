// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/variance_components.h"

#include <gtest/gtest.h>

#include "tests/testing/colmap_ext/bundle_world_problem.h"
#include "tests/testing/colmap_ext/mapper_drive.h"

namespace adasfm {
namespace {

TEST(ComputePriorMeanSquare, IsZeroAtThePriorsAndCapsWhatIsWild) {
  const MapperWorld world = BuildDrive(1);
  colmap::Reconstruction model = Reconstruct(world);
  std::vector<PosePriorEdge> priors = ProblemOf(world, model).priors;
  for (PosePriorEdge& edge : priors) {
    edge.cam2_from_cam1 =
        ComputeCam2FromCam1(CamFromWorld(model.Image(edge.image_id1)),
                            CamFromWorld(model.Image(edge.image_id2)));
  }
  EXPECT_NEAR(ComputePriorMeanSquare(priors, model), 0.0, 1e-9);
  // Two sigmas of length on every edge: a mean square of four.
  std::vector<PosePriorEdge> longer = priors;
  for (PosePriorEdge& edge : longer) {
    Eigen::Vector3d& t = edge.cam2_from_cam1.translation;
    t *= 1.0 + 2.0 * edge.length_sigma_m / t.norm();
  }
  EXPECT_NEAR(ComputePriorMeanSquare(longer, model), 4.0, 1e-6);
  // One grossly wrong edge of n is clipped at three sigmas and counts 9 / n.
  std::vector<PosePriorEdge> wild = priors;
  wild[5].cam2_from_cam1.translation *= 1e3;
  EXPECT_NEAR(ComputePriorMeanSquare(wild, model), 9.0 / priors.size(), 1e-6);
  EXPECT_EQ(ComputePriorMeanSquare({}, model), 0.0);
}

TEST(AdjustBundleWithVarianceComponents, LeavesIndependentNoiseAlone) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildDrive(seed);
    colmap::Reconstruction model = Reconstruct(world);
    double factor = 1.0;
    EXPECT_TRUE(AdjustBundleWithVarianceComponents(
                    {}, {}, ProblemOf(world, model), &model, &factor)
                    .success);
    EXPECT_EQ(factor, 1.0) << "seed " << seed;
  }
}

// All keypoints share an error: the camera's focal length is 5 % off, so that
// rotations and lengths contradict each other.
TEST(AdjustBundleWithVarianceComponents,
     BelievesPriorsWhereKeypointsShareAnError) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    MapperWorld world = BuildDrive(seed);
    world.data.cameras.at(1).SetFocalLengthX(
        1.05 * world.data.cameras.at(1).FocalLengthX());
    const colmap::Reconstruction start = Reconstruct(world);
    const PriorBundleAdjustmentProblem problem = ProblemOf(world, start);
    VarianceComponentOptions balance;

    colmap::Reconstruction balanced = start;
    double factor = 1.0;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundleWithVarianceComponents(balance, {}, problem, &balanced,
                                           &factor);
    balance.enabled = false;
    colmap::Reconstruction plain = start;
    double plain_factor = 1.0;
    const PriorBundleAdjustmentSummary plain_summary =
        AdjustBundleWithVarianceComponents(balance, {}, problem, &plain,
                                           &plain_factor);

    EXPECT_EQ(plain_factor, 1.0);
    // Shared errors explain part of the contradiction; the balance is computed
    // from priors that are corrected for them.
    const auto chi2_of = [&](const PriorBundleAdjustmentSummary& adjustment,
                             const colmap::Reconstruction& model) {
      return ComputePriorMeanSquare(
          CorrectSharedErrors({}, adjustment.shared_errors, problem.priors),
          model);
    };
    const double plain_chi2 = chi2_of(plain_summary, plain);
    EXPECT_GT(plain_chi2, kMaxPriorMeanSquare) << "seed " << seed;
    EXPECT_GT(factor, 1.0) << "seed " << seed;
    EXPECT_LE(factor, balance.max_sigma_factor);
    const double chi2 = chi2_of(summary, balanced);
    EXPECT_LT(chi2, plain_chi2) << "seed " << seed;
    EXPECT_TRUE(chi2 <= kMaxPriorMeanSquare ||
                factor == balance.max_sigma_factor);
  }
}

// A blurred and a sharp camera are each weighted by their own noise.
TEST(AdjustBundleWithVarianceComponents, WeighsEachCameraByItsNoise) {
  double error_m = 0.0;
  double error_of_one_sigma_m = 0.0;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    BundleWorldOptions options;
    options.seed = seed;
    options.num_images = 40;
    options.pixel_noise_px = 0.3;
    options.second_camera_noise_px = 1.5;
    colmap::Reconstruction model = BuildBundleWorld(options);
    const PriorBundleAdjustmentProblem problem = ProblemOfAll(model);
    ASSERT_TRUE(AdjustBundle({}, problem, &model).success);
    error_of_one_sigma_m += AlignedCenterError(options, model);
    double factor = 1.0;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundleWithVarianceComponents({}, {}, problem, &model, &factor);
    ASSERT_TRUE(summary.success);
    EXPECT_NEAR(summary.keypoint_sigma_ratios.at(2) /
                    summary.keypoint_sigma_ratios.at(1),
                1.5 / 0.3, 1.0)
        << "seed " << seed;
    error_m += AlignedCenterError(options, model);
  }
  EXPECT_LT(error_m, 0.9 * error_of_one_sigma_m);
}

}  // namespace
}  // namespace adasfm
