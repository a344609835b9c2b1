// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/bundle_reducer.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

struct JointStep {
  double predicted_decrease = 0.0;
  double decrease = 0.0;
};

// One step of an adjustment whose cameras, within 0.4 m, see points 12 to 36 m
// away, with half a pixel of noise.
JointStep StepAtLittleParallax(uint64_t seed, bool by_inverse_distance) {
  BundleWorldOptions world;
  world.spacing_m = 0.02;
  world.num_keypoints_per_image = 10000;
  world.pixel_noise_px = 0.5;
  world.seed = seed;
  colmap::Reconstruction model = BuildBundleWorld(world);
  PerturbBundleWorld(2e-3, 0.05, seed, &model);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(model);
  problem.priors = TruePriors(world);
  BundleProblem bundle({}, problem, model, /*may_keep_points_apart=*/true);
  bundle.FixFirstPose();
  BundleReducer reducer(&bundle, 1);
  const double cost = reducer.Linearize(/*inverse_radius=*/1e-10);
  const Eigen::MatrixXd lower = reducer.Matrix().Matrix();
  const Eigen::MatrixXd information = lower.selfadjointView<Eigen::Lower>();
  const BundleReducer::Step moved = reducer.Move(
      information.ldlt().solve(-reducer.Gradient()), by_inverse_distance);
  MinimizePointOptions stay;
  stay.max_num_iterations = 0;
  return {moved.predicted_decrease, cost - reducer.MinimizePoints(stay)};
}

// Keypoints are almost linear in inverse distances. The same step in xyz takes
// some points behind their cameras or far away.
TEST(BundleReducerTest, StepsByInverseDistanceDecreaseTheCostMore) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    const JointStep by_inverse = StepAtLittleParallax(seed, true);
    const JointStep by_xyz = StepAtLittleParallax(seed, false);
    EXPECT_EQ(by_inverse.predicted_decrease, by_xyz.predicted_decrease);
    EXPECT_GT(by_inverse.decrease, by_xyz.decrease);
  }
}

}  // namespace
}  // namespace adasfm
