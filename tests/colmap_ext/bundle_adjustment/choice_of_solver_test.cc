// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

TEST(ChoiceOfSolverTest, EverySizeOfSolverGivesTheSame) {
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

TEST(ChoiceOfSolverTest, ThreadsChangeNothing) {
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
TEST(ChoiceOfSolverTest, CutsPointsWhereMemoryIsBounded) {
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

}  // namespace
}  // namespace adasfm
