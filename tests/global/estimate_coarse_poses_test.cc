// SPDX-License-Identifier: BSD-3-Clause
#include "global/estimate_coarse_poses.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/so3.h"
#include "tests/testing/global/coarse_problem.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

TEST(EstimateCoarsePoses, AliasedWorldsWithBlackoutsAreSolvedInMetres) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const CoarseProblem problem = BuildCoarseProblem(AliasedWorld(seed));
    ASSERT_FALSE(problem.aliases.empty());
    const CoarsePoses result =
        EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                            problem.correspondences, problem.priors);
    ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
    const CoarseComponent& component = result.components.front();
    EXPECT_EQ(component.cams_from_world.size(), problem.graph.images.size());
    EXPECT_TRUE(component.metric);
    EXPECT_TRUE(component.rotations_converged);
    const AlignedErrors errors = ComputeAlignedErrors(
        component.cams_from_world, problem.truth, AlignmentOptions());
    EXPECT_LT(errors.rmse_m, 0.5) << "seed " << seed;
    // The sensors' common scale error has a sigma of 0.4 %.
    EXPECT_NEAR(errors.scale, 1.0, 0.0125) << "seed " << seed;
    for (const ViewGraphEdge& edge : result.graph.edges) {
      if (problem.aliases.count(edge.Pair())) {
        EXPECT_TRUE(!edge.IsKept() || edge.source != EdgeSource::kVisual);
      }
    }
  }
}

// Simulates a stop of the car: adds copies of an image with other keypoint
// noise, some of it gross. Copies share matches with each other and with all
// images that share matches with the original.
void AddStop(image_t image_id, int num_copies, Random* random,
             CoarseProblem* problem) {
  auto& bearings = problem->correspondences.bearings;
  const std::vector<ViewGraphEdge> edges = problem->graph.edges;
  const auto onward =
      std::find_if(problem->priors.begin(), problem->priors.end(),
                   [&](const auto& p) { return p.image_id1 == image_id; });
  std::vector<FeatureMatch> all;
  for (size_t k = 0; k < bearings.at(image_id).size(); ++k) {
    all.push_back({point2D_t(k), point2D_t(k)});
  }
  std::vector<image_t> standing = {image_id};
  std::vector<RelativePosePrior> priors;
  for (int i = 0; i < num_copies; ++i) {
    const image_t copy = problem->graph.images.back() + 1;
    problem->graph.images.push_back(copy);
    problem->truth[copy] = problem->truth.at(image_id);
    bearings[copy] = bearings.at(image_id);
    for (Bearing& bearing : bearings[copy]) {
      const double sigma_px = random->Uniform(0.0, 1.0) < 0.15 ? 5.0 : 0.5;
      bearing.direction =
          (bearing.direction +
           bearing.jacobian * random->GaussianVector(sigma_px).head<2>())
              .normalized();
    }
    for (const image_t other : standing) {
      ViewGraphEdge edge = BuildEdge(
          ImagePair(other, copy),
          Rigid3d(Eigen::Quaterniond::Identity(), random->UnitVector()));
      edge.num_inliers = all.size();
      problem->graph.edges.push_back(edge);
      problem->correspondences.matches[edge.Pair()] = all;
    }
    for (const ViewGraphEdge& edge : edges) {
      if (edge.image_id1 != image_id && edge.image_id2 != image_id) continue;
      ViewGraphEdge copied = edge;
      std::vector<FeatureMatch> matches =
          problem->correspondences.matches.at(edge.Pair());
      (edge.image_id1 == image_id ? copied.image_id1 : copied.image_id2) = copy;
      if (copied.image_id1 > copied.image_id2) {
        std::swap(copied.image_id1, copied.image_id2);
        copied.cam2_from_cam1 = copied.cam2_from_cam1.Inverse();
        copied.cam2_from_cam1.translation.normalize();
        for (FeatureMatch& match : matches) {
          std::swap(match.point2D_idx1, match.point2D_idx2);
        }
      }
      problem->graph.edges.push_back(copied);
      problem->correspondences.matches[copied.Pair()] = matches;
    }
    priors.push_back(BuildPrior(standing.back(), copy, Rigid3d(),
                                DegToRad(0.02), 1e-3, random));
    standing.push_back(copy);
  }
  onward->image_id1 = standing.back();
  problem->priors.insert(onward, priors.begin(), priors.end());
  std::sort(problem->graph.edges.begin(), problem->graph.edges.end(),
            [](const auto& a, const auto& b) { return a.Pair() < b.Pair(); });
}

TEST(EstimateCoarsePoses, AStopIsNoContradiction) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.seed = seed;
    CoarseProblem problem = BuildCoarseProblem(options);
    Random random(seed);
    AddStop(20, 8, &random, &problem);
    AddStop(40, 8, &random, &problem);
    const CoarsePoses result =
        EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                            problem.correspondences, problem.priors);
    ASSERT_EQ(result.components.size(), 1u);
    EXPECT_EQ(result.components[0].cams_from_world.size(), 76u);
    EXPECT_TRUE(result.components[0].positions_converged) << "seed " << seed;
    for (const ViewGraphEdge& edge : result.graph.edges) {
      EXPECT_TRUE(edge.removal != EdgeRemoval::kOdometryPose &&
                  edge.removal != EdgeRemoval::kOdometry)
          << "seed " << seed << ": " << edge.image_id1 << ", "
          << edge.image_id2;
    }
  }
}

// Visual odometry adds the edge of a step without a prior. Priors of images
// without pairs, which make up the number, must not hide the hole.
TEST(EstimateCoarsePoses, VisionCompletesAHoleInThePriors) {
  SyntheticWorldOptions options = AliasedWorld(1);
  options.num_blackouts = 0;
  CoarseProblem problem = BuildCoarseProblem(options);
  const auto added_edges = [&problem] {
    const CoarsePoses result =
        EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                            problem.correspondences, problem.priors);
    return std::any_of(
        result.steps.begin(), result.steps.end(), [](const CoarseStep& step) {
          return step.summary.find("vision gave 1 ") != std::string::npos;
        });
  };
  EXPECT_FALSE(added_edges());
  const size_t hole = problem.priors.size() / 2;
  RelativePosePrior outside = problem.priors[hole];
  problem.priors.erase(problem.priors.begin() + hole);
  EXPECT_TRUE(added_edges());
  for (const image_t image_id : {100001u, 100002u}) {
    outside.image_id1 = image_id;
    outside.image_id2 = image_id + 1;
    problem.priors.insert(problem.priors.end() - 1, outside);
    std::swap(problem.priors[problem.priors.size() - 2], problem.priors.back());
  }
  EXPECT_TRUE(added_edges());
}

// Rotations alone cannot reject aliased pairs in streets of one direction;
// translations of visual odometry can.
TEST(EstimateCoarsePoses, VisionCompletesAnImuWithoutWheels) {
  int num_aliases_without = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options = AliasedWorld(seed);
    options.num_blackouts = 0;
    CoarseProblem problem = BuildCoarseProblem(options);
    for (RelativePosePrior& prior : problem.priors) DropPosition(&prior);
    CoarsePoseOptions without;
    without.use_visual_odometry = false;
    num_aliases_without +=
        CountKeptPairs(problem, EstimateCoarsePoses(without, problem.graph,
                                                    problem.correspondences,
                                                    problem.priors)
                                    .graph)
            .num_aliases;
    const CoarsePoses result =
        EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                            problem.correspondences, problem.priors);
    ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
    const CoarseComponent& component = result.components[0];
    EXPECT_FALSE(component.metric);
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
  EXPECT_GT(num_aliases_without, 0);
}

// Wheels end half-way, or a hole in the logs splits the chain: the metric scale
// must reach the steps without positions.
TEST(EstimateCoarsePoses, VisionCompletesInterruptedSensors) {
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    SyntheticWorldOptions options = AliasedWorld(seed);
    options.num_blackouts = 0;
    const CoarseProblem whole = BuildCoarseProblem(options);
    CoarseProblem half = whole;
    for (size_t k = 80; k < half.priors.size(); ++k) {
      DropPosition(&half.priors[k]);
    }
    CoarseProblem hole = whole;
    hole.priors.erase(hole.priors.begin() + 70, hole.priors.begin() + 85);
    for (const CoarseProblem& problem : {half, hole}) {
      const CoarsePoses result =
          EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                              problem.correspondences, problem.priors);
      ASSERT_EQ(result.components.size(), 1) << "seed " << seed;
      const KeptPairs kept = CountKeptPairs(problem, result.graph);
      EXPECT_EQ(kept.num_aliases, 0) << "seed " << seed;
      EXPECT_GT(kept.share_of_true, 0.97) << "seed " << seed;
      const AlignedErrors errors =
          ComputeAlignedErrors(result.components[0].cams_from_world,
                               problem.truth, AlignmentOptions());
      EXPECT_LT(errors.rmse_m, 1.2) << "seed " << seed;
      EXPECT_NEAR(errors.scale, 1.0, 0.0125) << "seed " << seed;
    }
  }
}

// Behind a blackout without sensors only distant pairs could join the drive,
// and some of them are aliased. The images on one side must be a correct model
// of their own.
TEST(EstimateCoarsePoses, JoinsNothingBehindABlackoutWithoutSensors) {
  int num_split = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CoarseProblem wheels_end = BuildCoarseProblem(AliasedWorld(seed));
    CoarseProblem all_end = wheels_end;
    all_end.priors.resize(40);
    for (size_t k = 40; k < wheels_end.priors.size(); ++k) {
      DropPosition(&wheels_end.priors[k]);
    }
    for (const CoarseProblem& problem : {all_end, wheels_end}) {
      const CoarsePoses result =
          EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                              problem.correspondences, problem.priors);
      EXPECT_EQ(CountKeptPairs(problem, result.graph).num_aliases, 0)
          << "seed " << seed;
      num_split += result.components.size() > 1;
      for (const CoarseComponent& component : result.components) {
        EXPECT_TRUE(component.positions_converged) << "seed " << seed;
        EXPECT_TRUE(component.unconfirmed_closures.empty());
        // At most 240 m of road before any bundle adjustment: 0.5 %.
        EXPECT_LT(ComputeAlignedErrors(component.cams_from_world, problem.truth,
                                       AlignmentOptions())
                      .rmse_m,
                  1.2)
            << "seed " << seed;
      }
    }
  }
  EXPECT_GT(num_split, 0);
}

TEST(EstimateCoarsePoses, SensorsJoinWhatVisionSplits) {
  SyntheticWorldOptions options;
  options.num_images = 70;
  options.trajectory = SyntheticTrajectory::kStraight;
  CoarseProblem problem = BuildCoarseProblem(options);
  problem.graph.edges.erase(
      std::remove_if(problem.graph.edges.begin(), problem.graph.edges.end(),
                     [](const ViewGraphEdge& edge) {
                       return edge.image_id1 <= 40 && edge.image_id2 > 40;
                     }),
      problem.graph.edges.end());
  const CoarsePoses without = EstimateCoarsePoses(
      CoarsePoseOptions(), problem.graph, problem.correspondences, {});
  ASSERT_EQ(without.components.size(), 2);
  EXPECT_EQ(without.components[0].cams_from_world.size(), 40);
  EXPECT_EQ(without.components[1].cams_from_world.size(), 30);
  const CoarsePoses with =
      EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                          problem.correspondences, problem.priors);
  ASSERT_EQ(with.components.size(), 1);
  EXPECT_LT(ComputeAlignedErrors(with.components[0].cams_from_world,
                                 problem.truth, AlignmentOptions())
                .rmse_m,
            0.3);
}

TEST(EstimateCoarsePoses, DoesNotDependOnThreadsAndRejectsBadInput) {
  CoarseProblem problem = BuildCoarseProblem(AliasedWorld(4));
  CoarsePoseOptions options;
  options.num_threads = 1;
  const CoarsePoses one = EstimateCoarsePoses(
      options, problem.graph, problem.correspondences, problem.priors);
  options.num_threads = 3;
  const CoarsePoses three = EstimateCoarsePoses(
      options, problem.graph, problem.correspondences, problem.priors);
  ASSERT_EQ(one.components.size(), three.components.size());
  for (const auto& [image_id, pose] : one.components[0].cams_from_world) {
    const Rigid3d& other = three.components[0].cams_from_world.at(image_id);
    EXPECT_EQ(pose.rotation.coeffs(), other.rotation.coeffs());
    EXPECT_EQ(pose.translation, other.translation);
  }
  options.max_rotation_discrepancy_deg = -1.0;
  EXPECT_THROW(EstimateCoarsePoses(options, problem.graph,
                                   problem.correspondences, problem.priors),
               std::invalid_argument);
  std::swap(problem.graph.edges[0], problem.graph.edges[1]);
  EXPECT_THROW(EstimateCoarsePoses(CoarsePoseOptions(), problem.graph,
                                   problem.correspondences, problem.priors),
               std::invalid_argument);
  EXPECT_TRUE(EstimateCoarsePoses(CoarsePoseOptions(), ViewGraph(), {}, {})
                  .components.empty());
}

}  // namespace
}  // namespace adasfm
