// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "global/estimate_coarse_poses.h"
#include "tests/testing/global/coarse_problem.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

TEST(EstimateCoarsePosesWithoutSensors, WorksOnCleanAndFisheyeWorlds) {
  for (const auto model :
       {SyntheticCameraModel::kPinhole, SyntheticCameraModel::kFisheye}) {
    SyntheticWorldOptions options;
    options.num_images = 80;
    options.camera_model = model;
    const CoarseProblem problem = BuildCoarseProblem(options);
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    ASSERT_FALSE(result.components.empty());
    const CoarseComponent& component = result.components.front();
    EXPECT_EQ(component.cams_from_world.size(), 80);
    EXPECT_FALSE(component.metric);
    EXPECT_TRUE(component.positions_converged);
    const AlignedErrors errors = ComputeAlignedErrors(
        component.cams_from_world, problem.truth, AlignmentOptions());
    // 120 m of road before any bundle adjustment: 2 %.
    EXPECT_LT(errors.rmse_m, 2.4);
  }
}

// One wrong match of wide parallax among many true ones must not determine a
// baseline length, and with it the scale of half of the road.
TEST(EstimateCoarsePosesWithoutSensors, KeepsTheScaleAlongLongRoads) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 160;
    options.seed = seed;
    options.trajectory = SyntheticTrajectory::kStraight;
    const CoarseProblem problem = BuildCoarseProblem(options);
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
    EXPECT_TRUE(result.components[0].positions_converged);
    // 240 m of road: 1.5 %.
    EXPECT_LT(ComputeAlignedErrors(result.components[0].cams_from_world,
                                   problem.truth, AlignmentOptions())
                  .rmse_m,
              3.6)
        << "seed " << seed;
  }
}

// The order of capture is sufficient odometry to reject aliased pairs.
TEST(EstimateCoarsePosesWithoutSensors, LookAlikesDoNotFoldSequences) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options = AliasedWorld(seed);
    options.num_blackouts = 0;
    const CoarseProblem problem = Shuffle(BuildCoarseProblem(options), seed);
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
    const CoarseComponent& component = result.components[0];
    EXPECT_TRUE(component.positions_converged) << "seed " << seed;
    const KeptPairs kept = CountKeptPairs(problem, result.graph);
    EXPECT_EQ(kept.num_aliases, 0) << "seed " << seed;
    EXPECT_GT(kept.share_of_true, 0.97) << "seed " << seed;
    // 240 m of road before any bundle adjustment: 1.5 %.
    EXPECT_LT(ComputeAlignedErrors(component.cams_from_world, problem.truth,
                                   AlignmentOptions())
                  .rmse_m,
              3.6)
        << "seed " << seed;
  }
}

// At rest no pair has a direction, and none joins images before the stop to
// images behind it: the same points from one place do.
TEST(EstimateCoarsePosesWithoutSensors, StopsDoNotSplitSequences) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 120;
    options.seed = seed;
    options.num_stops = 1;
    options.stop_duration_s = 20.0;
    options.stop_image_interval_s = 0.5;
    CoarseProblem problem = BuildCoarseProblem(options);
    for (const bool is_ordered : {true, false}) {
      if (!is_ordered) {
        problem = Shuffle(problem, seed);
        problem.graph.capture_ranks.clear();
      }
      const CoarsePoses result = EstimateCoarsePoses(
          CoarsePoseOptions(), problem.graph, problem.correspondences, {});
      ASSERT_EQ(result.components.size(), 1)
          << "seed " << seed << ", ordered " << is_ordered;
      EXPECT_EQ(result.components[0].cams_from_world.size(), 120);
      EXPECT_TRUE(result.components[0].positions_converged);
      // 120 m of road before any bundle adjustment: 2 %.
      EXPECT_LT(ComputeAlignedErrors(result.components[0].cams_from_world,
                                     problem.truth, AlignmentOptions())
                    .rmse_m,
                2.4)
          << "seed " << seed << ", ordered " << is_ordered;
    }
  }
}

// Where a drive goes on after a stop its first steps measure centimetres, and
// the few of their matches with wide parallax are wrong ones. Lengths by these
// contradicted all true pairs and took the drives of seeds 4, 11 and 12 apart.
TEST(EstimateCoarsePosesWithoutSensors,
     TheFirstStepsAfterAStopHaveTheirLength) {
  for (const uint64_t seed : {4, 5, 11, 12}) {
    SyntheticWorldOptions options;
    options.num_images = 200;
    options.seed = seed;
    options.num_stops = 1;
    options.stop_duration_s = 12.0;
    const CoarseProblem problem = BuildCoarseProblem(options);
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
    EXPECT_EQ(result.components[0].cams_from_world.size(), 200);
    EXPECT_LT(result.loop_closures.num_contradicting, 5) << "seed " << seed;
  }
}

// Image 13 has one pair, with an image of the same pose. Both agree on an
// identical picture: of their own bonnet, or of the scene.
TEST(EstimateCoarsePosesWithoutSensors, ABonnetJoinsNothing) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    for (const bool is_bonnet : {true, false}) {
      TestSceneOptions options;
      options.num_images = 12;
      options.noise_px = 0.5;
      TestScene scene = BuildTestScene(options, seed);
      auto& edges = scene.graph.edges;
      const std::vector<Bearing> picture = scene.correspondences.bearings.at(6);
      std::vector<FeatureMatch>& matches =
          scene.correspondences.matches[ImagePair(6, 13)];
      // The bonnet is keypoints that no other image has.
      const point2D_t num_landmarks = picture.size();
      for (const image_t image_id : {6, 13}) {
        auto& bearings = scene.correspondences.bearings[image_id];
        bearings = picture;
        bearings.insert(bearings.end(), picture.begin(), picture.end());
      }
      for (point2D_t k = 0; k < num_landmarks; ++k) {
        const point2D_t index = is_bonnet ? num_landmarks + k : k;
        matches.push_back({index, index});
      }
      scene.graph.images.push_back(13);
      scene.cams_from_world[13] = scene.cams_from_world.at(6);
      edges.push_back(BuildEdge(ImagePair(6, 13), Rigid3d()));
      edges.back().cam2_from_cam1.translation = Eigen::Vector3d::UnitX();
      std::sort(edges.begin(), edges.end(), [](const auto& a, const auto& b) {
        return a.Pair() < b.Pair();
      });
      const CoarsePoses result = EstimateCoarsePoses(
          CoarsePoseOptions(), scene.graph, scene.correspondences, {});
      size_t num_images = 0;
      for (const CoarseComponent& component : result.components) {
        num_images += component.cams_from_world.count(13);
      }
      EXPECT_EQ(num_images, is_bonnet ? 0 : 1) << "seed " << seed;
    }
  }
}

// Aliased pairs must not join the parts that a blackout separates: each part is
// a model.
TEST(EstimateCoarsePosesWithoutSensors, BlackoutsSplitSequences) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const CoarseProblem problem =
        Shuffle(BuildCoarseProblem(AliasedWorld(seed)), 1);
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    size_t num_images = 0;
    for (const CoarseComponent& component : result.components) {
      num_images += component.cams_from_world.size();
      EXPECT_TRUE(component.positions_converged) << "seed " << seed;
      // 240 m of road before any bundle adjustment: 1.5 %.
      EXPECT_LT(ComputeAlignedErrors(component.cams_from_world, problem.truth,
                                     AlignmentOptions())
                    .rmse_m,
                3.6)
          << "seed " << seed;
    }
    // The blackout of 12 images has no pairs.
    EXPECT_GE(num_images, problem.graph.images.size() - 12);
    EXPECT_EQ(CountKeptPairs(problem, result.graph).num_aliases, 0);
  }
}

// One false pair of another street passed for the second place beyond a turn
// while all chains had the sigmas of bad ones.
TEST(EstimateCoarsePosesWithoutSensors, ParallelStreetsJoinNoSegments) {
  for (const uint64_t seed : {21, 53}) {
    SyntheticWorldOptions options;
    options.num_images = 150;
    options.seed = seed;
    options.trajectory = SyntheticTrajectory::kParallel;
    options.street_num_blocks = 2;
    options.spacing_m = 3.0;
    options.num_sequential_neighbors = 6;
    options.alias_pair_ratio = 0.2;
    options.num_blackouts = 3;
    options.blackout_num_images = 10;
    const CoarseProblem problem = BuildCoarseProblem(options);
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    EXPECT_EQ(result.components.size(), 4) << "seed " << seed;
    EXPECT_EQ(CountKeptPairs(problem, result.graph).num_aliases, 0)
        << "seed " << seed;
  }
}

// Unordered photos must lose no pairs to checks that assume a sequence.
TEST(EstimateCoarsePosesWithoutSensors, UnorderedImagesAreNoSequence) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.seed = seed;
    CoarseProblem problem = Shuffle(BuildCoarseProblem(options), seed);
    problem.graph.capture_ranks.clear();
    const CoarsePoses result = EstimateCoarsePoses(
        CoarsePoseOptions(), problem.graph, problem.correspondences, {});
    ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
    for (const ViewGraphEdge& edge : result.graph.edges) {
      EXPECT_NE(edge.removal, EdgeRemoval::kOdometryPose);
      EXPECT_NE(edge.removal, EdgeRemoval::kOdometry);
      EXPECT_NE(edge.removal, EdgeRemoval::kFalseLoop);
    }
  }
}

}  // namespace
}  // namespace adasfm
