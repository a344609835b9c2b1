// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/drop_contradicted_steps.h"

#include <gtest/gtest.h>

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

VisualSteps AddSteps(const TestScene& scene,
                     const std::vector<RelativePosePrior>& priors = {}) {
  return AddVisualSteps(VisualStepOptions(), EdgeLengthOptions(), scene.graph,
                        scene.correspondences, {}, priors);
}

int Drop(const TestScene& scene, VisualSteps* steps,
         size_t num_sensor_priors = 0) {
  return DropContradictedSteps(VisualStepOptions(), LoopClosureOptions(),
                               OdometryChainOptions(), scene.graph,
                               num_sensor_priors, steps);
}

void Turn(double angle_rad, ViewGraphEdge* edge) {
  edge->cam2_from_cam1.rotation = ExpSo3(Eigen::Vector3d(0.0, angle_rad, 0.0)) *
                                  edge->cam2_from_cam1.rotation;
}

TEST(DropContradictedSteps, ASequenceKeepsAllItsSteps) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const TestScene scene = BuildScene(seed);
    VisualSteps steps = AddSteps(scene);
    ASSERT_EQ(steps.priors.size(), kNumImages - 1);
    EXPECT_EQ(Drop(scene, &steps), 0) << "seed " << seed;
    EXPECT_EQ(steps.priors.size(), kNumImages - 1);
  }
}

TEST(DropContradictedSteps, OnlyTheWrongStepGoes) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    TestScene scene = BuildScene(seed);
    const image_t wrong = 5 + 2 * seed;
    Turn(
        0.4,
        &scene.graph.edges[FindEdge(scene.graph, ImagePair(wrong, wrong + 1))]);
    VisualSteps steps = AddSteps(scene);
    EXPECT_EQ(Drop(scene, &steps), 1) << "seed " << seed;
    for (const RelativePosePrior& step : steps.priors) {
      EXPECT_NE(step.image_id1, wrong);
    }
    // A step of sensors stays, whatever vision says.
    steps = AddSteps(scene);
    EXPECT_EQ(Drop(scene, &steps, steps.priors.size()), 0);
  }
}

// Odometry that a fifth of the short pairs contradict excludes nothing.
TEST(DropContradictedSteps, ShakyOdometryIsGivenUp) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    TestScene scene = BuildScene(seed);
    Random random(seed);
    for (ViewGraphEdge& edge : scene.graph.edges) {
      const image_t gap = edge.image_id2 - edge.image_id1;
      if (gap > 1 && random.Uniform(0.0, 1.0) < 0.2) Turn(0.4, &edge);
    }
    VisualSteps steps = AddSteps(scene);
    // A run of a few steps may be free of them.
    EXPECT_GE(Drop(scene, &steps), kNumImages - 1 - 3) << "seed " << seed;
  }
}

}  // namespace
}  // namespace adasfm
