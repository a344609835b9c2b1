// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/pair_agreement.h"

#include <gtest/gtest.h>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {
namespace {

// A drive and its true poses.
struct Drive {
  explicit Drive(uint64_t seed) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.seed = seed;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    scene = BuildSyntheticScene(world, SyntheticPriorOptions());
    bearings = ComputeSceneBearings(scene, -1);
    graph = BuildInitialViewGraph(scene, bearings).graph;
    for (const SyntheticImage& image : world.images) {
      poses[image.image_id] = image.cam_from_world;
    }
  }
  PairAgreement Measure() const {
    return MeasurePairAgreement(MatchRefinementOptions(), scene, graph, poses,
                                bearings);
  }
  SceneData scene;
  std::map<image_t, std::vector<Bearing>> bearings;
  ViewGraph graph;
  std::map<image_t, Rigid3d> poses;
};

TEST(MeasurePairAgreement, AllPairsOfTheTruthAgree) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const PairAgreement agreement = Drive(seed).Measure();
    EXPECT_EQ(agreement.share, 1.0) << "seed " << seed;
    EXPECT_EQ(agreement.least_image_share, 1.0) << "seed " << seed;
  }
}

// A bend of ten degrees at one place: pairs on either side agree, pairs across
// do not.
TEST(MeasurePairAgreement, ABendShowsAtTheImagesBesideIt) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Drive drive(seed);
    const Eigen::Vector3d centre = drive.poses.at(30).TargetOriginInSource();
    const Eigen::Quaterniond turn = ExpSo3(Eigen::Vector3d(0, 0, DegToRad(10)));
    for (auto& [image_id, cam_from_world] : drive.poses) {
      if (image_id <= 30) continue;
      cam_from_world = CamFromWorldWithCenter(
          cam_from_world.rotation * turn.conjugate(),
          centre + turn * (cam_from_world.TargetOriginInSource() - centre));
    }
    const PairAgreement agreement = drive.Measure();
    EXPECT_GT(agreement.share, 0.8) << "seed " << seed;
    EXPECT_LT(agreement.least_image_share, 0.7) << "seed " << seed;
    EXPECT_FALSE(agreement.IsSound());
  }
}

TEST(MeasurePairAgreement, NothingToAskIsNoContradiction) {
  Drive drive(1);
  drive.graph.edges.clear();
  EXPECT_TRUE(drive.Measure().IsSound());
}

// Without odometry aliased pairs may fold the world; the agreement is unsound
// exactly then.
TEST(MeasurePairAgreement, TellsFoldedWorlds) {
  int num_folded = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 160;
    options.seed = seed;
    options.alias_pair_ratio = 0.05;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    SyntheticPriorOptions no_priors;
    no_priors.enabled = false;
    SceneData scene = BuildSyntheticScene(world, no_priors);
    GlobalStageOptions without;
    without.poses.use_visual_odometry = false;
    const StatusOr<GlobalStageResult> result = RunGlobalStage(without, &scene);
    ASSERT_TRUE(result.ok()) << result.status().message();
    const CoarseModel& model = result->models.front();
    const double rmse_m = ComparePoses(world, model.reconstruction).rmse_m;
    const bool is_folded = rmse_m >= 10.0;
    num_folded += is_folded;
    EXPECT_EQ(model.pair_agreement.IsSound(), !is_folded)
        << "seed " << seed << ": " << rmse_m << " m";
  }
  EXPECT_GT(num_folded, 0);
}

}  // namespace
}  // namespace adasfm
