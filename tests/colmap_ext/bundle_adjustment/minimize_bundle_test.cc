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

// One adjustment with its true priors, by Ceres and by MinimizeBundle.
struct Solutions {
  ceres::Solver::Summary expected;
  MinimizeBundleSummary summary;
  // Adjusted, in this order.
  colmap::Reconstruction models[2];
};

Solutions SolveBoth(const BundleWorldOptions& world,
                    const MinimizeBundleOptions& minimize,
                    double rotation_error_rad, double position_error_m) {
  Solutions solutions;
  for (colmap::Reconstruction& model : solutions.models) {
    model = BuildBundleWorld(world);
    PerturbBundleWorld(rotation_error_rad, position_error_m, world.seed,
                       &model);
  }
  PriorBundleAdjustmentProblem problem = ProblemOfAll(solutions.models[0]);
  problem.priors = TruePriors(world);
  const PriorBundleAdjustmentOptions options;
  BundleProblem listed(options, problem, solutions.models[0]);
  listed.FixFirstPose();
  solutions.expected = SolveWithCeres(minimize, &listed);
  BundleProblem apart(options, problem, solutions.models[1],
                      /*may_keep_points_apart=*/true);
  apart.FixFirstPose();
  EXPECT_EQ(apart.NumPointsApart(), listed.NumPoints());
  EXPECT_EQ(apart.NumResiduals(), listed.NumResiduals());
  solutions.summary = MinimizeBundle(minimize, &apart);
  EXPECT_TRUE(solutions.summary.success);
  EXPECT_EQ(solutions.summary.num_iterations,
            solutions.expected.num_successful_steps +
                solutions.expected.num_unsuccessful_steps);
  EXPECT_NEAR(solutions.summary.initial_cost, solutions.expected.initial_cost,
              1e-10 * solutions.expected.initial_cost);
  EXPECT_NEAR(solutions.summary.final_cost, solutions.expected.final_cost,
              1e-8 * solutions.expected.final_cost);
  listed.WriteTo(&solutions.models[0]);
  apart.WriteTo(&solutions.models[1]);
  return solutions;
}

// From near the minimum, and from where steps are refused.
TEST(MinimizeBundleTest, MakesTheStepsOfCeres) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  MinimizeBundleOptions minimize;
  minimize.initial_radius = 1e7;
  for (const double position_error_m : {0.05, 2.0}) {
    SCOPED_TRACE(position_error_m);
    const Solutions solutions =
        SolveBoth(world, minimize, 2e-2, position_error_m);
    EXPECT_GT(solutions.summary.num_iterations, 3);
    const auto& [by_ceres, by_points] = solutions.models;
    for (const image_t id : by_ceres.RegImageIds()) {
      EXPECT_LT((by_points.Image(id).Tvec() - by_ceres.Image(id).Tvec()).norm(),
                1e-6);
    }
  }
}

// Spacing so small that images see most of each other's points: a factorisation
// takes longer than iterations with an earlier factor.
TEST(MinimizeBundleTest, ReusesAFactorThatTakesLong) {
  MinimizeBundleOptions minimize;
  minimize.function_tolerance = 1e-8;
  minimize.initial_radius = 1e10;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    BundleWorldOptions world;
    world.num_images = 200;
    world.spacing_m = 0.3;
    world.pixel_noise_px = 0.5;
    world.seed = seed;
    const Solutions solutions = SolveBoth(world, minimize, 2e-3, 0.05);
    EXPECT_LT(solutions.summary.num_factorizations,
              solutions.summary.num_iterations);
  }
}

}  // namespace
}  // namespace adasfm
