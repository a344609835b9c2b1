// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/visual_odometry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/so3.h"
#include "global/odometry/odometry_chain.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 12;

struct StepProblem {
  TestScene scene;
  std::vector<RelativePosePrior> priors;
  std::map<ImagePair, double> known_lengths_m;
};

// An arc. The sensors measure all rotations, but positions only of the steps
// that has_position selects.
template <typename Function>
StepProblem BuildProblem(uint64_t seed, Function has_position) {
  StepProblem problem;
  TestSceneOptions options;
  options.num_images = kNumImages;
  options.noise_px = 0.3;
  problem.scene = BuildTestScene(options, seed);
  Random random(seed);
  const auto& poses = problem.scene.cams_from_world;
  for (auto it = poses.begin(); std::next(it) != poses.end(); ++it) {
    const auto next = std::next(it);
    RelativePosePrior prior = BuildPrior(
        it->first, next->first, ComputeCam2FromCam1(it->second, next->second),
        1e-4, 1e-3, &random);
    if (has_position(static_cast<int>(problem.priors.size()))) {
      problem.known_lengths_m[ImagePair(it->first, next->first)] =
          prior.cam2_from_cam1.translation.norm();
    } else {
      prior.flags = kPriorRotation;
      prior.cam2_from_cam1.translation.setZero();
    }
    problem.priors.push_back(prior);
  }
  return problem;
}

VisualOdometryEdges Complete(const StepProblem& problem) {
  constexpr int kNumThreads = -1;
  return AddVisualOdometry(kNumThreads, problem.scene.graph,
                           problem.scene.correspondences,
                           problem.known_lengths_m, problem.priors);
}

// Estimated over true distance from first to last image, by the full chain.
double LengthRatioOfTheWay(const StepProblem& problem,
                           const VisualOdometryEdges& steps) {
  const OdometryChain chain(steps.priors, OdometryChainOptions());
  const auto& poses = problem.scene.cams_from_world;
  const ChainMotion motion =
      chain.Motion(poses.begin()->first, poses.rbegin()->first);
  EXPECT_TRUE(motion.has_position);
  const Rigid3d truth =
      ComputeCam2FromCam1(poses.begin()->second, poses.rbegin()->second);
  EXPECT_GT(motion.cam2_from_cam1.translation.normalized().dot(
                truth.translation.normalized()),
            0.99);
  return motion.cam2_from_cam1.translation.norm() / truth.translation.norm();
}

TEST(AddVisualOdometry, SpreadsMetresToTheStepsWithoutPosition) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const StepProblem problem = BuildProblem(seed, [](int k) { return k < 4; });
    const VisualOdometryEdges steps = Complete(problem);
    EXPECT_EQ(steps.num_by_vision, kNumImages - 1 - 4);
    EXPECT_EQ(steps.unit_m, 1.0);
    EXPECT_NEAR(LengthRatioOfTheWay(problem, steps), 1.0, 0.1) << seed;
    // Motions that the sensors measured are kept.
    EXPECT_EQ(steps.priors[2].cam2_from_cam1.translation,
              problem.priors[2].cam2_from_cam1.translation);
  }
}

TEST(AddVisualOdometry, WithoutMetresTheUnitIsAStep) {
  const StepProblem problem = BuildProblem(1, [](int) { return false; });
  const VisualOdometryEdges steps = Complete(problem);
  EXPECT_EQ(steps.num_by_vision, kNumImages - 1);
  const double first = steps.priors[0].cam2_from_cam1.translation.norm();
  const auto& poses = problem.scene.cams_from_world;
  const double truth = ComputeCam2FromCam1(poses.begin()->second,
                                           std::next(poses.begin())->second)
                           .translation.norm();
  EXPECT_NEAR(LengthRatioOfTheWay(problem, steps), first / truth,
              0.1 * first / truth);
  EXPECT_NEAR(steps.unit_m, first, 0.5 * first);
}

// The sigmas of the pairs, however small, say nothing of a second optimum.
TEST(AddVisualOdometry, SigmasHaveAFloor) {
  StepProblem problem = BuildProblem(1, [](int) { return false; });
  for (ViewGraphEdge& edge : problem.scene.graph.edges) {
    edge.direction_sigma_rad = 1e-3;
  }
  for (const RelativePosePrior& step : Complete(problem).priors) {
    const Eigen::Vector3d& translation = step.cam2_from_cam1.translation;
    const Eigen::Matrix3d covariance =
        step.covariance.bottomRightCorner<3, 3>();
    const double along = translation.dot(covariance * translation);
    EXPECT_GT(along, std::pow(0.1 * translation.squaredNorm(), 2));
    EXPECT_GT(covariance.trace() - along / translation.squaredNorm(),
              2.0 * std::pow(0.0499, 2) * translation.squaredNorm());
  }
}

// Steps that neither sensors nor vision observe stay open.
TEST(AddVisualOdometry, NothingGoesOnThroughAHole) {
  StepProblem problem = BuildProblem(1, [](int) { return false; });
  for (ViewGraphEdge& edge : problem.scene.graph.edges) {
    if (edge.image_id1 <= 7 && edge.image_id2 >= 6) {
      edge.removal = EdgeRemoval::kFewInliers;
    }
  }
  const VisualOdometryEdges steps = Complete(problem);
  EXPECT_LT(steps.num_by_vision, kNumImages - 1);
}

TEST(AddVisualOdometry, ContinuesAnInterruptedChain) {
  StepProblem problem = BuildProblem(1, [](int) { return true; });
  problem.priors.erase(problem.priors.begin() + 5);
  const VisualOdometryEdges steps = Complete(problem);
  EXPECT_EQ(steps.priors.size(), kNumImages - 1);
  EXPECT_EQ(steps.num_by_vision, 1);
  EXPECT_NEAR(LengthRatioOfTheWay(problem, steps), 1.0, 0.1);
}

// Sensors measured all rotations and every other position.
TEST(ScaleVisualSigmas, SensorsKeepTheirs) {
  const StepProblem problem =
      BuildProblem(1, [](int step) { return step % 2 == 0; });
  const VisualOdometryEdges steps = Complete(problem);
  std::vector<RelativePosePrior> scaled = steps.priors;
  ScaleVisualSigmas(problem.priors, 0.5, &scaled);
  for (size_t k = 0; k < scaled.size(); ++k) {
    const double ratio = problem.priors[k].HasMotion() ? 1.0 : 0.25;
    EXPECT_EQ(scaled[k].covariance.topLeftCorner(3, 3),
              steps.priors[k].covariance.topLeftCorner(3, 3));
    EXPECT_EQ(scaled[k].covariance.bottomRightCorner(3, 3),
              ratio * steps.priors[k].covariance.bottomRightCorner(3, 3));
  }
}

}  // namespace
}  // namespace adasfm
