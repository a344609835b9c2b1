// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/join_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/testing/colmap_ext/global_stage_run.h"

namespace adasfm {
namespace {

constexpr size_t kNumImages = 80;

std::string JoinsOf(const GlobalStageResult& result) {
  const auto step =
      std::find_if(result.steps.begin(), result.steps.end(),
                   [](const auto& s) { return s.name == "joins of models"; });
  return step == result.steps.end() ? "" : step->summary;
}

// Few keypoints and images far apart: pairs at turns have no relative scale
// before the adjustment. Without joins there are two or three models.
TEST(JoinModelsTest, MakesOneModelOfASparseDrive) {
  for (const uint64_t seed : {2, 3, 5}) {
    SyntheticWorldOptions options;
    options.num_images = kNumImages;
    options.seed = seed;
    options.spacing_m = 2.0;
    options.num_keypoints_per_image = 50;
    options.num_sequential_neighbors = 4;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    SyntheticPriorOptions priors;
    priors.enabled = false;
    const GlobalStageResult result =
        RunStage(BuildSyntheticScene(world, priors));
    EXPECT_NE(JoinsOf(result).substr(0, 2), "0 ") << seed;
    ASSERT_EQ(result.models.size(), 1) << seed;
    EXPECT_EQ(result.poses.components.size(), 1);
    const colmap::Reconstruction& model = result.models[0].reconstruction;
    EXPECT_EQ(model.NumRegImages(), kNumImages);
    // The relative scale of the largest of three parts, 60 m, is known to 5 %.
    EXPECT_LT(ComparePoses(world, model).rmse_m, 0.05 * 60.0 / std::sqrt(12.0))
        << seed;
  }
}

// Turning on the spot gives no relative scale: lanes stay apart.
TEST(JoinModelsTest, TurnsOnTheSpotJoinNothing) {
  SyntheticWorldOptions options;
  options.num_images = 200;
  options.trajectory = SyntheticTrajectory::kLanes;
  options.spacing_m = 0.5;
  options.image_interval_s = 0.5;
  options.num_spins = 5;
  SyntheticPriorOptions priors;
  priors.enabled = false;
  const GlobalStageResult result =
      RunStage(BuildSyntheticScene(BuildSyntheticWorld(options), priors));
  EXPECT_GT(result.models.size(), 1);
  EXPECT_EQ(JoinsOf(result).substr(0, 2), "0 ");
}

}  // namespace
}  // namespace adasfm
