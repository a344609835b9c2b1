// SPDX-License-Identifier: BSD-3-Clause
#include "global/estimate_coarse_poses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

struct CoarseProblem {
  ViewGraph graph;
  GlobalCorrespondences correspondences;
  std::vector<RelativePosePrior> priors;
  std::map<image_t, Rigid3d> truth;
  std::set<ImagePair> aliases;
};

// Priors: true motion with 0.02 deg and 1 % of white noise a step and 0.4 % of
// common scale.
CoarseProblem BuildProblem(const SyntheticWorldOptions& options) {
  const SyntheticWorld world = BuildSyntheticWorld(options);
  Random random(options.seed);
  CoarseProblem problem;
  const double scale = 1.0 + random.Gaussian(0.004);
  for (size_t k = 0; k < world.images.size(); ++k) {
    const SyntheticImage& image = world.images[k];
    problem.graph.images.push_back(image.image_id);
    problem.truth[image.image_id] = image.cam_from_world;
    problem.correspondences.bearings[image.image_id] =
        ComputeBearings(world.camera, image);
    if (k == 0) continue;
    const SyntheticImage& last = world.images[k - 1];
    Rigid3d motion =
        ComputeCam2FromCam1(last.cam_from_world, image.cam_from_world);
    const double sigma_m = 0.01 * motion.translation.norm() + 1e-3;
    motion.translation *= scale;
    problem.priors.push_back(BuildPrior(last.image_id, image.image_id, motion,
                                        DegToRad(0.02), sigma_m, &random));
    problem.priors.back().dt_ns = image.timestamp_ns - last.timestamp_ns;
  }
  for (const SyntheticPair& pair : world.pairs) {
    if (pair.inlier_matches.size() < 15) continue;
    ViewGraphEdge edge = BuildEdge(ImagePair(pair.image_id1, pair.image_id2),
                                   pair.cam2_from_cam1);
    edge.num_inliers = pair.inlier_matches.size();
    problem.graph.edges.push_back(edge);
    problem.correspondences.matches[edge.Pair()] = pair.inlier_matches;
    if (pair.is_alias) problem.aliases.insert(edge.Pair());
  }
  return problem;
}

SyntheticWorldOptions AliasedWorld(uint64_t seed) {
  SyntheticWorldOptions options;
  options.num_images = 160;
  options.seed = seed;
  options.alias_pair_ratio = 0.05;
  options.num_blackouts = 1;
  options.blackout_num_images = 12;
  return options;
}

TEST(EstimateCoarsePoses, AliasedWorldsWithBlackoutsAreSolvedInMetres) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const CoarseProblem problem = BuildProblem(AliasedWorld(seed));
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

// The car stops after an image: copies of it with other noise, a part of which
// is gross, on the keypoints. They share what the image shares.
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
    CoarseProblem problem = BuildProblem(options);
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

TEST(EstimateCoarsePoses, WorksWithoutSensorsOnCleanAndFisheyeWorlds) {
  for (const auto model :
       {SyntheticCameraModel::kPinhole, SyntheticCameraModel::kFisheye}) {
    SyntheticWorldOptions options;
    options.num_images = 80;
    options.camera_model = model;
    const CoarseProblem problem = BuildProblem(options);
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

// One wrong match of wide parallax among many true ones must not set an edge's
// length, and with it the scale of half of the road.
TEST(EstimateCoarsePoses, KeepsTheScaleAlongLongRoadsWithoutSensors) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 160;
    options.seed = seed;
    options.trajectory = SyntheticTrajectory::kStraight;
    const CoarseProblem problem = BuildProblem(options);
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

// What an IMU without wheels leaves of the priors.
void DropPosition(RelativePosePrior* prior) {
  prior->flags = kPriorRotation;
  prior->cam2_from_cam1.translation.setZero();
  prior->covariance.bottomRightCorner<3, 3>() =
      std::numeric_limits<double>::infinity() * Eigen::Matrix3d::Identity();
}

struct KeptPairs {
  int num_aliases = 0;
  double share_of_true = 0.0;
};

KeptPairs CountKeptPairs(const CoarseProblem& problem, const ViewGraph& graph) {
  KeptPairs kept;
  int num_true = 0;
  int num_true_kept = 0;
  for (const ViewGraphEdge& edge : graph.edges) {
    const bool is_kept = edge.IsKept() && edge.source != EdgeSource::kSensor;
    if (problem.aliases.count(edge.Pair())) {
      kept.num_aliases += is_kept && edge.num_inliers > 0;
    } else if (edge.num_inliers > 0) {
      ++num_true;
      num_true_kept += is_kept;
    }
  }
  kept.share_of_true = static_cast<double>(num_true_kept) / num_true;
  return kept;
}

// Rotations alone cannot tell look-alike places in streets of one direction
// apart; the way that vision sees between them does.
TEST(EstimateCoarsePoses, VisionCompletesAnImuWithoutWheels) {
  int num_aliases_without = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options = AliasedWorld(seed);
    options.num_blackouts = 0;
    CoarseProblem problem = BuildProblem(options);
    for (RelativePosePrior& prior : problem.priors) DropPosition(&prior);
    CoarsePoseOptions without;
    without.visual_steps.enabled = false;
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

// The same images under ids in random order, and how they were captured.
CoarseProblem Shuffle(const CoarseProblem& problem, uint64_t seed) {
  std::vector<image_t> ids = problem.graph.images;
  Random(seed).Shuffle(&ids);
  std::map<image_t, image_t> new_id;
  for (size_t k = 0; k < ids.size(); ++k) {
    new_id[problem.graph.images[k]] = ids[k];
  }
  CoarseProblem shuffled;
  shuffled.graph.images = problem.graph.images;
  shuffled.graph.capture_ranks.resize(ids.size());
  for (size_t k = 0; k < ids.size(); ++k) {
    shuffled.graph.capture_ranks[shuffled.graph.IndexOf(ids[k])] = k;
  }
  for (const auto& [image_id, bearings] : problem.correspondences.bearings) {
    shuffled.correspondences.bearings[new_id[image_id]] = bearings;
  }
  for (const auto& [image_id, pose] : problem.truth) {
    shuffled.truth[new_id[image_id]] = pose;
  }
  for (ViewGraphEdge edge : problem.graph.edges) {
    std::vector<FeatureMatch> matches =
        problem.correspondences.matches.at(edge.Pair());
    const bool is_alias = problem.aliases.count(edge.Pair()) > 0;
    edge.image_id1 = new_id[edge.image_id1];
    edge.image_id2 = new_id[edge.image_id2];
    if (edge.image_id1 > edge.image_id2) {
      std::swap(edge.image_id1, edge.image_id2);
      edge.cam2_from_cam1 = edge.cam2_from_cam1.Inverse();
      for (FeatureMatch& match : matches) {
        std::swap(match.point2D_idx1, match.point2D_idx2);
      }
    }
    if (is_alias) shuffled.aliases.insert(edge.Pair());
    shuffled.correspondences.matches[edge.Pair()] = std::move(matches);
    shuffled.graph.edges.push_back(edge);
  }
  std::sort(shuffled.graph.edges.begin(), shuffled.graph.edges.end(),
            [](const ViewGraphEdge& a, const ViewGraphEdge& b) {
              return a.Pair() < b.Pair();
            });
  return shuffled;
}

// The order of capture is odometry enough.
TEST(EstimateCoarsePoses, LookAlikesDoNotFoldSequencesWithoutSensors) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options = AliasedWorld(seed);
    options.num_blackouts = 0;
    const CoarseProblem problem = Shuffle(BuildProblem(options), seed);
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

// Look-alike places do not join what a blackout separates: each part is a
// model.
TEST(EstimateCoarsePoses, BlackoutsSplitSequencesWithoutSensors) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const CoarseProblem problem = Shuffle(BuildProblem(AliasedWorld(seed)), 1);
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

// Photos in any order lose nothing by it.
TEST(EstimateCoarsePoses, UnorderedImagesAreNoSequence) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.seed = seed;
    CoarseProblem problem = Shuffle(BuildProblem(options), seed);
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

// Wheels that end half-way, or logs with a hole that splits the chain: metres
// are spread over the rest.
TEST(EstimateCoarsePoses, VisionCompletesInterruptedSensors) {
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    SyntheticWorldOptions options = AliasedWorld(seed);
    options.num_blackouts = 0;
    const CoarseProblem whole = BuildProblem(options);
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
// and look-alikes are among them: what stands on one side only is a model of
// its own, and sound.
TEST(EstimateCoarsePoses, JoinsNothingBehindABlackoutWithoutSensors) {
  int num_split = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CoarseProblem wheels_end = BuildProblem(AliasedWorld(seed));
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
        EXPECT_TRUE(component.unverified_joins.empty());
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
  CoarseProblem problem = BuildProblem(options);
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
  CoarseProblem problem = BuildProblem(AliasedWorld(4));
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
