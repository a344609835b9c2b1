// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/filter_loop_closures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

// Two laps of a square block, 1 m a step: images k and k + kLap see the same
// place. Aliased places: one side of the block and the opposite side seen in
// the other direction, and places 40 m apart along one side.
constexpr int kSide = 100;
constexpr int kLap = 4 * kSide;

Rigid3d TruePose(int k) {
  const int side = (k / kSide) % 4;
  const double along = k % kSide;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  for (int s = 0; s < side; ++s) {
    center +=
        kSide * Eigen::Vector2d(std::sin(s * kPi / 2), std::cos(s * kPi / 2));
  }
  center += along *
            Eigen::Vector2d(std::sin(side * kPi / 2), std::cos(side * kPi / 2));
  return CamFromWorldWithCenter(ExpSo3(Eigen::Vector3d(0, -side * kPi / 2, 0)),
                                Eigen::Vector3d(center.x(), 0, center.y()));
}

struct LoopProblem {
  ViewGraph graph;
  std::vector<bool> is_alias;
  TrajectoryOdometry odometry;
};

void AddEdge(int i, int j, const Rigid3d& seen, bool is_alias, bool has_length,
             LoopProblem* problem) {
  Rigid3d motion = seen;
  const double length = motion.translation.norm();
  motion.translation.normalize();
  problem->graph.edges.push_back(BuildEdge(ImagePair(i + 1, j + 1), motion));
  problem->is_alias.push_back(is_alias);
  problem->odometry.lengths.emplace_back();
  if (has_length) {
    problem->odometry.lengths.back() = EdgeLength{length, 0.05};
  }
}

LoopProblem BuildProblem(uint64_t seed, double length_ratio) {
  Random random(seed);
  LoopProblem problem;
  // A common error of scale and gyro bias of one sigma each, and white noise.
  OdometryChainOptions options;
  options.scale_sigma = 0.005;
  options.gyro_bias_sigma_rad_s = 2e-4;
  const double scale = 1.0 + random.Gaussian(options.scale_sigma);
  const Eigen::Vector3d bias =
      random.GaussianVector(options.gyro_bias_sigma_rad_s);
  std::vector<RelativePosePrior> priors;
  for (int k = 0; k < 2 * kLap; ++k) {
    problem.graph.images.push_back(k + 1);
    if (k + 1 == 2 * kLap) break;
    Rigid3d step = ComputeCam2FromCam1(TruePose(k), TruePose(k + 1));
    step.rotation = ExpSo3(0.1 * bias) * step.rotation;
    step.translation *= scale;
    priors.push_back(BuildPrior(k + 1, k + 2, step, 3e-4, 0.01, &random));
  }
  problem.odometry.chain = OdometryChain(priors, options);
  problem.odometry.priors = priors;
  for (int i = 0; i < 2 * kLap; ++i) {
    for (int j = i + 1; j < 2 * kLap; ++j) {
      const bool has_length = random.Uniform(0, 1) < length_ratio;
      if (j - i <= 3) {
        AddEdge(i, j, ComputeCam2FromCam1(TruePose(i), TruePose(j)), false,
                has_length, &problem);
      } else if (std::abs(j - i - kLap) <= 3 && j - i != kLap) {
        AddEdge(i, j, ComputeCam2FromCam1(TruePose(i), TruePose(j)), false,
                has_length, &problem);
      } else if (i % kSide < 50 && i < kSide && std::abs(j - i - 40) <= 2 &&
                 j < kSide && j - i != 40) {
        // The place 40 m ahead is aliased with this one.
        AddEdge(i, j, ComputeCam2FromCam1(TruePose(i + 40), TruePose(j)), true,
                has_length, &problem);
      }
    }
  }
  return problem;
}

void ExpectOnlyAliasesRemoved(const LoopProblem& problem, uint64_t seed) {
  int num_true_removed = 0;
  int num_alias_kept = 0;
  for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
    const bool is_kept = problem.graph.edges[e].IsKept();
    num_true_removed += !problem.is_alias[e] && !is_kept;
    num_alias_kept += problem.is_alias[e] && is_kept;
  }
  EXPECT_EQ(num_true_removed, 0) << "seed " << seed;
  EXPECT_EQ(num_alias_kept, 0) << "seed " << seed;
}

TEST(FilterLoopClosures, KeepsTrueLoopsAndDropsLookAlikes) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    LoopProblem problem = BuildProblem(seed, 1.0);
    const LoopClosureReport report = FilterLoopClosures(
        LoopClosureOptions(), problem.odometry, &problem.graph);
    ExpectOnlyAliasesRemoved(problem, seed);
    EXPECT_GT(report.num_false_clusters, 0);
    EXPECT_EQ(report.num_segments, 1);
    EXPECT_EQ(report.num_tested, problem.graph.edges.size());
    for (const ViewGraphEdge& edge : problem.graph.edges) {
      EXPECT_NE(edge.removal, EdgeRemoval::kOdometryPose);
    }
  }
}

// Pairs of which only rotation and direction are known are rejected with the
// false loop that they belong to.
TEST(FilterLoopClosures, DropsUntestablePairsOfAFalseLoop) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    LoopProblem problem = BuildProblem(seed, 0.5);
    const LoopClosureReport report = FilterLoopClosures(
        LoopClosureOptions(), problem.odometry, &problem.graph);
    EXPECT_GT(report.num_pairs_of_false_clusters, 0);
    ExpectOnlyAliasesRemoved(problem, seed);
  }
}

// A wrong pose at a place that the drive truly revisits, or of neighbouring
// images, is removed as a wrong pose: its matches may be used again.
TEST(FilterLoopClosures, AWrongPoseOfATruePlaceIsNoFalseLoop) {
  LoopProblem problem = BuildProblem(1, 1.0);
  const Eigen::Quaterniond turn = ExpSo3(Eigen::Vector3d(0.0, 0.5, 0.0));
  const int loop = FindEdge(problem.graph, ImagePair(51, 51 + kLap + 1));
  const int near = FindEdge(problem.graph, ImagePair(81, 83));
  for (const int e : {loop, near}) {
    ASSERT_GE(e, 0);
    Rigid3d& motion = problem.graph.edges[e].cam2_from_cam1;
    motion.rotation = turn * motion.rotation;
  }
  FilterLoopClosures(LoopClosureOptions(), problem.odometry, &problem.graph);
  const int num_edges = static_cast<int>(problem.graph.edges.size());
  for (int e = 0; e < num_edges; ++e) {
    const EdgeRemoval removal = problem.graph.edges[e].removal;
    if (e == loop || e == near) {
      EXPECT_EQ(removal, EdgeRemoval::kOdometryPose);
    } else if (problem.is_alias[e]) {
      EXPECT_TRUE(removal == EdgeRemoval::kOdometry ||
                  removal == EdgeRemoval::kFalseLoop);
    } else {
      EXPECT_EQ(removal, EdgeRemoval::kKept);
    }
  }
}

TEST(FilterLoopClosures, LeavesPhotosAlone) {
  LoopProblem problem = BuildProblem(1, 1.0);
  problem.odometry.chain = OdometryChain();
  problem.odometry.priors.clear();
  LoopClosureOptions options;
  options.split_unconfirmed_closures = false;
  const LoopClosureReport report =
      FilterLoopClosures(options, problem.odometry, &problem.graph);
  EXPECT_EQ(report.num_tested, 0);
  for (const ViewGraphEdge& edge : problem.graph.edges) {
    EXPECT_TRUE(edge.IsKept());
  }
  EXPECT_THROW(
      FilterLoopClosures(options, TrajectoryOdometry(), &problem.graph),
      std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
