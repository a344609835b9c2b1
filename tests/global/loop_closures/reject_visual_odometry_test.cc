// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/reject_visual_odometry.h"

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

}  // namespace
}  // namespace adasfm
