// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/filter_loops_by_odometry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

// Two laps of a square block, 1 m a step: image k and k + kLap see the same
// place. Look-alike places: one side of the block and the opposite one, seen
// driving the other way, and places along one side 40 m apart.
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
  EdgeLengths lengths;
  std::vector<bool> is_alias;
  OdometryChain chain;
};

void AddEdge(int i, int j, const Rigid3d& seen, bool is_alias, bool has_length,
             LoopProblem* problem) {
  Rigid3d motion = seen;
  const double length = motion.translation.norm();
  motion.translation.normalize();
  problem->graph.edges.push_back(BuildEdge(ImagePair(i + 1, j + 1), motion));
  problem->is_alias.push_back(is_alias);
  problem->lengths.lengths.emplace_back();
  if (has_length) {
    problem->lengths.lengths.back() = EdgeLength{length, 0.05};
  }
}

LoopProblem BuildProblem(uint64_t seed, double length_ratio) {
  Random random(seed);
  LoopProblem problem;
  problem.lengths.metric = true;
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
  problem.chain = OdometryChain(priors, options);
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
        // 40 m ahead looks like here.
        AddEdge(i, j, ComputeCam2FromCam1(TruePose(i + 40), TruePose(j)), true,
                has_length, &problem);
      }
    }
  }
  return problem;
}

TEST(FilterLoopsByOdometry, KeepsTrueLoopsAndDropsLookAlikes) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    LoopProblem problem = BuildProblem(seed, 1.0);
    const LoopFilterReport report = FilterLoopsByOdometry(
        LoopFilterOptions(), problem.chain, problem.lengths, &problem.graph);
    int num_true_removed = 0;
    int num_alias_kept = 0;
    for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
      const bool is_kept = problem.graph.edges[e].IsKept();
      num_true_removed += !problem.is_alias[e] && !is_kept;
      num_alias_kept += problem.is_alias[e] && is_kept;
    }
    EXPECT_EQ(num_true_removed, 0) << "seed " << seed;
    EXPECT_EQ(num_alias_kept, 0) << "seed " << seed;
    EXPECT_EQ(report.num_false_runs, 1);
    EXPECT_EQ(report.num_tested, problem.graph.edges.size());
  }
}

// Pairs of which nothing is known but the rotation fall with their run.
TEST(FilterLoopsByOdometry, DropsUntestablePairsOfAFalseRun) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    LoopProblem problem = BuildProblem(seed, 0.5);
    const LoopFilterReport report = FilterLoopsByOdometry(
        LoopFilterOptions(), problem.chain, problem.lengths, &problem.graph);
    EXPECT_GT(report.num_in_false_runs, 0);
    for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
      EXPECT_EQ(problem.graph.edges[e].IsKept(), !problem.is_alias[e])
          << "seed " << seed << " edge " << e;
    }
    LoopFilterOptions options;
    options.max_contradicting_ratio = 1.0;
    problem = BuildProblem(seed, 0.5);
    EXPECT_EQ(FilterLoopsByOdometry(options, problem.chain, problem.lengths,
                                    &problem.graph)
                  .num_in_false_runs,
              0);
  }
}

// One pair that nothing confirms, with no length to test, in streets of one
// direction: where the drive truly comes back, its neighbours would see it too.
TEST(FilterLoopsByOdometry, ALonePairIsNoEvidence) {
  LoopProblem problem = BuildProblem(1, 1.0);
  AddEdge(10, 80, Rigid3d(Eigen::Quaterniond::Identity(), {0.1, 0.0, -1.0}),
          true, false, &problem);
  const size_t lone = problem.graph.edges.size() - 1;
  FilterLoopsByOdometry(LoopFilterOptions(), problem.chain, problem.lengths,
                        &problem.graph);
  EXPECT_EQ(problem.graph.edges[lone].removal, EdgeRemoval::kFalseLoop);
  // With others beside it the case is open.
  problem = BuildProblem(1, 1.0);
  for (const int k : {0, 1, 2}) {
    AddEdge(10 + k, 80 + k,
            Rigid3d(Eigen::Quaterniond::Identity(), {0.1, 0.0, -1.0}), true,
            false, &problem);
  }
  FilterLoopsByOdometry(LoopFilterOptions(), problem.chain, problem.lengths,
                        &problem.graph);
  EXPECT_TRUE(problem.graph.edges[lone].IsKept());
}

// Nothing is known of a pair's length, but it leads the wrong way: most of its
// points are on a car ahead, or it looks alike.
TEST(FilterLoopsByOdometry, PairsOfUnknownLengthMustLeadTheRightWay) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    LoopProblem problem = BuildProblem(seed, 1.0);
    for (int k = 200; k < 260; k += 5) {
      const bool is_reversed = k % 2 == 0;
      Rigid3d seen = ComputeCam2FromCam1(TruePose(k), TruePose(k + 6));
      if (is_reversed) seen.translation = -seen.translation;
      AddEdge(k, k + 6, seen, is_reversed, false, &problem);
    }
    FilterLoopsByOdometry(LoopFilterOptions(), problem.chain, problem.lengths,
                          &problem.graph);
    for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
      EXPECT_EQ(problem.graph.edges[e].IsKept(), !problem.is_alias[e])
          << "seed " << seed << " edge " << e;
    }
  }
}

// A pair without a baseline says that both images are at one place, which the
// chain can refute without any length.
TEST(FilterLoopsByOdometry, PlacesThatCoincideMustBeNear) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    LoopProblem problem = BuildProblem(seed, 1.0);
    for (int k = 0; k < 3; ++k) {
      AddEdge(10 + k, 80 + k, Rigid3d(), true, false, &problem);
      problem.graph.edges.back().has_baseline = false;
      AddEdge(5 + k, kLap + 5 + k, Rigid3d(), false, false, &problem);
      problem.graph.edges.back().has_baseline = false;
    }
    FilterLoopsByOdometry(LoopFilterOptions(), problem.chain, problem.lengths,
                          &problem.graph);
    for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
      EXPECT_EQ(problem.graph.edges[e].IsKept(), !problem.is_alias[e])
          << "seed " << seed << " edge " << e;
    }
  }
}

}  // namespace
}  // namespace adasfm
