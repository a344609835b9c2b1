// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/rotation_averaging.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/so3.h"
#include "global/rotation_averaging/filter_edges_by_rotation.h"
#include "tests/testing/global/test_scene.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

using Rotations = std::map<image_t, Eigen::Quaterniond>;

struct RotationProblem {
  Rotations truth;
  ViewGraph graph;
};

RotationProblem BuildProblem(int num_images, int num_chords, double noise_rad,
                             double outlier_ratio, uint64_t seed) {
  Random random(seed);
  RotationProblem problem;
  for (int k = 1; k <= num_images; ++k) {
    problem.graph.images.push_back(k);
    problem.truth[k] = ExpSo3(random.UnitVector() * random.Uniform(0, kPi));
  }
  for (const ImagePair& pair :
       BuildRandomPairs(num_images, num_chords, &random)) {
    Eigen::Quaterniond rotation = ExpSo3(random.GaussianVector(noise_rad)) *
                                  problem.truth.at(pair.image_id2) *
                                  problem.truth.at(pair.image_id1).conjugate();
    if (random.Uniform(0, 1) < outlier_ratio) {
      rotation = ExpSo3(random.UnitVector() * random.Uniform(0.5, kPi));
    }
    problem.graph.edges.push_back(
        BuildEdge(pair, Rigid3d(rotation, Eigen::Vector3d::UnitX())));
    problem.graph.edges.back().rotation_sigma_rad = std::max(1e-3, noise_rad);
  }
  return problem;
}

// The least-squares optimum near a start: dense Gauss-Newton with numeric
// differences of Log(R_j R_i^T R_ij^T), the first rotation fixed.
Rotations SolveDensely(const ViewGraph& graph, Rotations rotations) {
  const int size = 3 * (graph.images.size() - 1);
  const auto residuals = [&graph](const Rotations& at) {
    Eigen::VectorXd values(3 * graph.edges.size());
    for (size_t e = 0; e < graph.edges.size(); ++e) {
      const ViewGraphEdge& edge = graph.edges[e];
      values.segment<3>(3 * e) =
          LogSo3(at.at(edge.image_id2) * at.at(edge.image_id1).conjugate() *
                 edge.cam2_from_cam1.rotation.conjugate());
    }
    return values;
  };
  const auto moved = [&graph](Rotations at, const Eigen::VectorXd& step) {
    for (size_t i = 1; i < graph.images.size(); ++i) {
      Eigen::Quaterniond& rotation = at.at(graph.images[i]);
      rotation = ExpSo3(step.segment<3>(3 * (i - 1))) * rotation;
    }
    return at;
  };
  for (int iteration = 0; iteration < 10; ++iteration) {
    const Eigen::VectorXd base = residuals(rotations);
    Eigen::MatrixXd jacobian(base.size(), size);
    for (int k = 0; k < size; ++k) {
      constexpr double kStep = 1e-6;
      Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(size, k);
      const Eigen::VectorXd above = residuals(moved(rotations, step));
      const Eigen::VectorXd below = residuals(moved(rotations, -step));
      jacobian.col(k) = (above - below) / (2.0 * kStep);
    }
    rotations = moved(rotations, -(jacobian.transpose() * jacobian)
                                      .ldlt()
                                      .solve(jacobian.transpose() * base));
  }
  return rotations;
}

TEST(RotationAveraging, IsExactWithoutNoiseWithAndWithoutSdp) {
  for (const bool use_sdp_start : {false, true}) {
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      const RotationProblem problem = BuildProblem(40, 60, 0.0, 0.0, seed);
      RotationAveragingOptions options;
      options.use_sdp_start = use_sdp_start;
      const GlobalRotations result =
          EstimateGlobalRotations(options, problem.graph);
      ASSERT_TRUE(result.success);
      EXPECT_TRUE(result.converged);
      EXPECT_LT(
          ComputeAlignedRotationError(result.cams_from_world, problem.truth),
          1e-6);
      EXPECT_EQ(result.sdp_rank > 0, use_sdp_start);
      if (use_sdp_start) {
        EXPECT_GT(result.sdp_optimality, 0.99);
      }
    }
  }
}

TEST(RotationAveraging, FindsTruthAmongSixtyPercentOutliers) {
  constexpr double kNoiseRad = 0.01;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const RotationProblem problem = BuildProblem(60, 900, kNoiseRad, 0.6, seed);
    const GlobalRotations result =
        EstimateGlobalRotations(RotationAveragingOptions(), problem.graph);
    ASSERT_TRUE(result.success);
    // About 12 good edges a node.
    EXPECT_LT(
        ComputeAlignedRotationError(result.cams_from_world, problem.truth),
        kNoiseRad)
        << "seed " << seed;
  }
}

TEST(RotationAveraging, AgreesWithADenseSolver) {
  // So little that the robust loss, which takes over at 2 deg, is plain
  // squares.
  constexpr double kNoiseRad = 2e-4;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const RotationProblem problem = BuildProblem(8, 10, kNoiseRad, 0.0, seed);
    const GlobalRotations result =
        EstimateGlobalRotations(RotationAveragingOptions(), problem.graph);
    ASSERT_TRUE(result.success);
    // From another start, so that the reference does not reuse the result.
    const Rotations reference = SolveDensely(problem.graph, problem.truth);
    // The iterations' linearisation drops terms of second order in the noise.
    EXPECT_LT(ComputeAlignedRotationError(result.cams_from_world, reference),
              10.0 * kNoiseRad * kNoiseRad);
  }
}

TEST(RotationAveraging, SurvivesLongChains) {
  const RotationProblem problem = BuildProblem(3000, 0, 0.001, 0.0, 1);
  const GlobalRotations result =
      EstimateGlobalRotations(RotationAveragingOptions(), problem.graph);
  ASSERT_TRUE(result.success);
  for (const auto& [image_id, rotation] : result.cams_from_world) {
    ASSERT_TRUE(rotation.coeffs().allFinite());
  }
  // A ring's random walk, tied at both ends: sigma sqrt(n) / 2 a component.
  EXPECT_LT(ComputeAlignedRotationError(result.cams_from_world, problem.truth),
            0.001 * std::sqrt(3000.0) * 1.73);
}

TEST(RotationAveraging, RefusesDisconnectedGraphs) {
  RotationProblem problem = BuildProblem(5, 0, 0.0, 0.0, 1);
  problem.graph.images.push_back(99);
  EXPECT_FALSE(
      EstimateGlobalRotations(RotationAveragingOptions(), problem.graph)
          .success);
  EXPECT_FALSE(
      EstimateGlobalRotations(RotationAveragingOptions(), ViewGraph()).success);
}

TEST(FilterEdgesByRotation, RemovesWhatIsOffByMoreThanTheThreshold) {
  RotationProblem problem = BuildProblem(6, 4, 0.0, 0.0, 1);
  Eigen::Quaterniond& rotation = problem.graph.edges[2].cam2_from_cam1.rotation;
  rotation = ExpSo3(Eigen::Vector3d(DegToRad(6.0), 0, 0)) * rotation;
  EXPECT_EQ(FilterEdgesByRotation(7.0, problem.truth, &problem.graph), 0);
  EXPECT_EQ(FilterEdgesByRotation(5.0, problem.truth, &problem.graph), 1);
  EXPECT_EQ(problem.graph.edges[2].removal, EdgeRemoval::kRotation);
}

}  // namespace
}  // namespace adasfm
