// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/minimize_bundle.h"

#include <gtest/gtest.h>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

ceres::Solver::Summary SolveWithCeres(const MinimizeBundleOptions& options,
                                      BundleProblem* bundle) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = options.tolerance;
  solver.parameter_tolerance = options.tolerance;
  solver.initial_trust_region_radius = options.initial_radius;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering = bundle->Ordering();
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, bundle->CeresProblem(), &summary);
  return summary;
}

// From near the minimum, and from where steps are refused.
TEST(MinimizeBundleTest, MakesTheStepsOfCeres) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  for (const double position_error_m : {0.05, 2.0}) {
    colmap::Reconstruction models[] = {BuildBundleWorld(world),
                                       BuildBundleWorld(world)};
    for (auto& model : models) {
      PerturbBundleWorld(2e-2, position_error_m, 1, &model);
    }
    PriorBundleAdjustmentProblem problem = ProblemOfAll(models[0]);
    problem.priors = TruePriors(world);
    const PriorBundleAdjustmentOptions options;
    MinimizeBundleOptions minimize;
    minimize.initial_radius = 1e7;
    BundleProblem listed(options, problem, models[0]);
    listed.FixFirstPose();
    const ceres::Solver::Summary expected = SolveWithCeres(minimize, &listed);
    BundleProblem apart(options, problem, models[1],
                        /*may_keep_points_apart=*/true);
    apart.FixFirstPose();
    ASSERT_EQ(apart.NumPointsApart(), listed.NumPoints());
    EXPECT_EQ(apart.NumResiduals(), listed.NumResiduals());
    const MinimizeBundleSummary summary = MinimizeBundle(minimize, &apart);
    ASSERT_TRUE(summary.success);
    EXPECT_GT(summary.num_iterations, 3);
    EXPECT_EQ(summary.num_iterations,
              expected.num_successful_steps + expected.num_unsuccessful_steps);
    EXPECT_NEAR(summary.initial_cost, expected.initial_cost,
                1e-10 * expected.initial_cost);
    EXPECT_NEAR(summary.final_cost, expected.final_cost,
                1e-8 * expected.final_cost);
    listed.WriteTo(&models[0]);
    apart.WriteTo(&models[1]);
    for (const image_t id : models[0].RegImageIds()) {
      EXPECT_LT(
          (models[1].Image(id).Tvec() - models[0].Image(id).Tvec()).norm(),
          1e-6);
    }
  }
}

// Spacing so small that images see most of each other's points: a factorisation
// takes longer than iterations with an earlier factor.
TEST(MinimizeBundleTest, ReusesAFactorThatTakesLong) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    BundleWorldOptions world;
    world.num_images = 200;
    world.spacing_m = 0.3;
    world.pixel_noise_px = 0.5;
    world.seed = seed;
    colmap::Reconstruction models[] = {BuildBundleWorld(world),
                                       BuildBundleWorld(world)};
    for (auto& model : models) PerturbBundleWorld(2e-3, 0.05, seed, &model);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(models[0]);
    problem.priors = TruePriors(world);
    const PriorBundleAdjustmentOptions options;
    MinimizeBundleOptions minimize;
    minimize.function_tolerance = 1e-8;
    minimize.initial_radius = 1e10;
    BundleProblem listed(options, problem, models[0]);
    listed.FixFirstPose();
    const ceres::Solver::Summary expected = SolveWithCeres(minimize, &listed);
    BundleProblem apart(options, problem, models[1],
                        /*may_keep_points_apart=*/true);
    apart.FixFirstPose();
    const MinimizeBundleSummary summary = MinimizeBundle(minimize, &apart);
    ASSERT_TRUE(summary.success) << "seed " << seed;
    EXPECT_LT(summary.num_factorizations, summary.num_iterations)
        << "seed " << seed;
    EXPECT_EQ(summary.num_iterations,
              expected.num_successful_steps + expected.num_unsuccessful_steps)
        << "seed " << seed;
    EXPECT_NEAR(summary.final_cost, expected.final_cost,
                1e-8 * expected.final_cost)
        << "seed " << seed;
  }
}

}  // namespace
}  // namespace adasfm
