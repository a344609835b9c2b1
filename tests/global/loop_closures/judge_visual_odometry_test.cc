// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/judge_visual_odometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 20;

TestScene BuildScene(uint64_t seed) {
  TestSceneOptions options;
  options.num_images = kNumImages;
  options.noise_px = 0.3;
  options.max_gap = 6;
  return BuildTestScene(options, seed);
}

VisualOdometryEdges AddSteps(
    const TestScene& scene, const std::vector<RelativePosePrior>& priors = {}) {
  constexpr int kNumThreads = -1;
  return AddVisualOdometry(kNumThreads, scene.graph, scene.correspondences, {},
                           priors);
}

int Reject(const TestScene& scene, VisualOdometryEdges* steps,
           size_t num_sensor_priors = 0) {
  return RejectVisualOdometry(LoopClosureOptions(), OdometryChainOptions(),
                              scene.graph, num_sensor_priors, steps);
}

void Turn(double angle_rad, ViewGraphEdge* edge) {
  edge->cam2_from_cam1.rotation = ExpSo3(Eigen::Vector3d(0.0, angle_rad, 0.0)) *
                                  edge->cam2_from_cam1.rotation;
}

TEST(RejectVisualOdometry, ASequenceKeepsAll) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const TestScene scene = BuildScene(seed);
    VisualOdometryEdges steps = AddSteps(scene);
    ASSERT_EQ(steps.priors.size(), kNumImages - 1);
    EXPECT_EQ(Reject(scene, &steps), 0) << "seed " << seed;
    EXPECT_EQ(steps.priors.size(), kNumImages - 1);
  }
}

// Visual odometry that a fifth of the short pairs contradict is removed.
TEST(RejectVisualOdometry, ContradictedOdometryGoes) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    TestScene scene = BuildScene(seed);
    Random random(seed);
    for (ViewGraphEdge& edge : scene.graph.edges) {
      const image_t gap = edge.image_id2 - edge.image_id1;
      if (gap > 1 && random.Uniform(0.0, 1.0) < 0.2) Turn(0.4, &edge);
    }
    VisualOdometryEdges steps = AddSteps(scene);
    EXPECT_EQ(Reject(scene, &steps), kNumImages - 1) << "seed " << seed;
    EXPECT_TRUE(steps.priors.empty());
    // Odometry of sensors is kept even if vision contradicts it.
    steps = AddSteps(scene);
    EXPECT_EQ(Reject(scene, &steps, steps.priors.size()), 0);
  }
}

// A few wrong matches hold poses in a second optimum. Errors and stated sigmas
// as measured in world-alias-300.
TEST(RejectVisualOdometry, ErrorsOfASecondOptimumAreNoContradiction) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    TestScene scene = BuildScene(seed);
    Random random(seed);
    for (ViewGraphEdge& edge : scene.graph.edges) {
      edge.rotation_sigma_rad = DegToRad(0.08);
      edge.direction_sigma_rad = DegToRad(0.5);
      const bool is_step = edge.image_id2 - edge.image_id1 == 1;
      Rigid3d& pose = edge.cam2_from_cam1;
      pose.rotation =
          ExpSo3(random.GaussianVector(DegToRad(0.4))) * pose.rotation;
      pose.translation =
          ExpSo3(random.GaussianVector(DegToRad(is_step ? 9.0 : 2.2))) *
          pose.translation;
    }
    VisualOdometryEdges steps = AddSteps(scene);
    EXPECT_EQ(Reject(scene, &steps), 0) << "seed " << seed;
  }
}

// An odometry edge of sensors separates two runs: each run is tested by its own
// pairs.
TEST(RejectVisualOdometry, EachRunIsJudgedByItsOwnPairs) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    TestScene scene = BuildScene(seed);
    VisualOdometryEdges steps = AddSteps(scene);
    const auto sensor = std::find_if(
        steps.priors.begin(), steps.priors.end(),
        [](const RelativePosePrior& prior) { return prior.image_id1 == 12; });
    ASSERT_NE(sensor, steps.priors.end());
    std::iter_swap(steps.priors.begin(), sensor);
    for (ViewGraphEdge& edge : scene.graph.edges) {
      const image_t gap = edge.image_id2 - edge.image_id1;
      if (edge.image_id1 > 12 && gap == 3) Turn(0.4, &edge);
    }
    EXPECT_EQ(Reject(scene, &steps, 1), kNumImages - 13) << "seed " << seed;
    for (const RelativePosePrior& prior : steps.priors) {
      EXPECT_LE(prior.image_id1, 12);
    }
  }
}

// Steps whose rotations and directions err by `ratio` times their sigmas.
TestScene BuildErringScene(double ratio, uint64_t seed) {
  TestScene scene = BuildScene(seed);
  Random random(seed);
  for (ViewGraphEdge& edge : scene.graph.edges) {
    if (edge.image_id2 - edge.image_id1 > 1) continue;
    Rigid3d& pose = edge.cam2_from_cam1;
    pose.rotation = ExpSo3(random.GaussianVector(ratio * 0.01)) * pose.rotation;
    pose.translation =
        ExpSo3(random.GaussianVector(ratio * 0.05)) * pose.translation;
  }
  return scene;
}

double Fit(const TestScene& scene, VisualOdometryEdges* steps) {
  return FitVisualSigmas({}, OdometryChainOptions(), scene.graph, steps);
}

TEST(FitVisualSigmas, SigmasGrowWithTheErrors) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    double last = 0.0;
    for (const double error : {0.05, 0.3, 1.0, 3.0}) {
      const TestScene scene = BuildErringScene(error, seed);
      VisualOdometryEdges steps = AddSteps(scene);
      const std::vector<RelativePosePrior> before = steps.priors;
      const double ratio = Fit(scene, &steps);
      EXPECT_GE(ratio, last) << "seed " << seed << ", errors " << error;
      last = ratio;
      if (error == 0.05) {
        EXPECT_EQ(ratio, 0.35) << "seed " << seed;
      }
      for (size_t k = 0; k < before.size(); ++k) {
        EXPECT_TRUE(steps.priors[k].covariance.isApprox(
            ratio * ratio * before[k].covariance, 1e-12));
      }
    }
    EXPECT_EQ(last, 1.0) << "seed " << seed;
  }
}

// Neighbours alone say nothing about the errors of the steps between them.
TEST(FitVisualSigmas, WithoutPairsSigmasStay) {
  TestSceneOptions options;
  options.num_images = 60;
  options.max_gap = 1;
  const TestScene scene = BuildTestScene(options, 1);
  VisualOdometryEdges steps = AddSteps(scene);
  ASSERT_FALSE(steps.priors.empty());
  EXPECT_EQ(Fit(scene, &steps), 1.0);
}

}  // namespace
}  // namespace adasfm
