// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/translation_averaging.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/median.h"
#include "core/so3.h"
#include "tests/testing/global/test_scene.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

using Rotations = std::map<image_t, Eigen::Quaterniond>;

struct PositionProblem {
  std::map<image_t, Rigid3d> truth;
  Rotations rotations;
  ViewGraph graph;
  std::vector<std::optional<EdgeLength>> lengths;
};

PositionProblem BuildProblem(int num_images, int num_chords,
                             double direction_noise_rad, double outlier_ratio,
                             bool collinear, uint64_t seed) {
  Random random(seed);
  PositionProblem problem;
  for (int k = 1; k <= num_images; ++k) {
    problem.graph.images.push_back(k);
    Eigen::Vector3d center = random.GaussianVector(3.0);
    if (collinear) center = Eigen::Vector3d(1.0 * k, 0, 0);
    problem.rotations[k] = ExpSo3(random.UnitVector());
    problem.truth[k] = CamFromWorldWithCenter(problem.rotations[k], center);
  }
  for (const ImagePair& pair :
       BuildRandomPairs(num_images, num_chords, &random)) {
    Rigid3d motion = ComputeCam2FromCam1(problem.truth.at(pair.image_id1),
                                         problem.truth.at(pair.image_id2));
    const double length = motion.translation.norm();
    motion.translation = ExpSo3(random.GaussianVector(direction_noise_rad)) *
                         motion.translation.normalized();
    if (random.Uniform(0, 1) < outlier_ratio) {
      motion.translation = random.UnitVector();
    }
    problem.graph.edges.push_back(BuildEdge(pair, motion));
    problem.graph.edges.back().direction_sigma_rad =
        std::max(2e-3, direction_noise_rad);
    problem.lengths.push_back(EdgeLength{length, 0.02});
  }
  return problem;
}

AlignedErrors Errors(const PositionProblem& problem,
                     const std::map<image_t, Eigen::Vector3d>& centers) {
  std::map<image_t, Rigid3d> poses;
  for (const auto& [image_id, center] : centers) {
    poses[image_id] =
        CamFromWorldWithCenter(problem.rotations.at(image_id), center);
  }
  return ComputeAlignedErrors(poses, problem.truth, AlignmentOptions());
}

// Least unsquared deviations (Ozyesil and Singer 2015), the convex problem
// min sum |C_j - C_i - l_e d_e|, l_e >= 1, by alternating reweighted dense
// solves and exact lengths.
std::map<image_t, Eigen::Vector3d> SolveLud(const PositionProblem& problem) {
  const ViewGraph& graph = problem.graph;
  const int num_nodes = graph.images.size();
  Eigen::MatrixX3d centers = Eigen::MatrixX3d::Zero(num_nodes, 3);
  std::vector<double> weights(graph.edges.size(), 1.0);
  std::vector<double> lengths(graph.edges.size(), 1.0);
  for (int iteration = 0; iteration < 2000; ++iteration) {
    Eigen::MatrixXd laplacian = Eigen::MatrixXd::Zero(num_nodes, num_nodes);
    Eigen::MatrixX3d right_side = Eigen::MatrixX3d::Zero(num_nodes, 3);
    laplacian(0, 0) = 1.0;
    std::vector<Eigen::RowVector3d> directions;
    for (size_t e = 0; e < graph.edges.size(); ++e) {
      const ViewGraphEdge& edge = graph.edges[e];
      const int i = graph.IndexOf(edge.image_id1);
      const int j = graph.IndexOf(edge.image_id2);
      directions.push_back((problem.rotations.at(edge.image_id2).conjugate() *
                            -edge.cam2_from_cam1.translation)
                               .transpose());
      laplacian(i, i) += weights[e];
      laplacian(j, j) += weights[e];
      laplacian(i, j) -= weights[e];
      laplacian(j, i) -= weights[e];
      right_side.row(j) += weights[e] * lengths[e] * directions[e];
      right_side.row(i) -= weights[e] * lengths[e] * directions[e];
    }
    centers = laplacian.ldlt().solve(right_side);
    for (size_t e = 0; e < graph.edges.size(); ++e) {
      const ViewGraphEdge& edge = graph.edges[e];
      const Eigen::RowVector3d difference =
          centers.row(graph.IndexOf(edge.image_id2)) -
          centers.row(graph.IndexOf(edge.image_id1));
      lengths[e] = std::max(1.0, difference.dot(directions[e]));
      weights[e] =
          1.0 /
          std::max(1e-4, (difference - lengths[e] * directions[e]).norm());
    }
  }
  std::map<image_t, Eigen::Vector3d> result;
  for (int i = 0; i < num_nodes; ++i) {
    result[graph.images[i]] = centers.row(i).transpose();
  }
  return result;
}

TEST(TranslationAveraging, IsExactWithoutNoise) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const PositionProblem problem = BuildProblem(30, 60, 0, 0, false, seed);
    const GlobalPositions result =
        EstimateGlobalPositions(TranslationAveragingOptions(), problem.graph,
                                problem.rotations, problem.lengths, {});
    ASSERT_TRUE(result.success);
    EXPECT_TRUE(result.converged);
    EXPECT_FALSE(result.metric);
    EXPECT_LT(Errors(problem, result.centers).rmse_m, 1e-3);
  }
}

TEST(TranslationAveraging, KeepsMetresOfSensorEdges) {
  PositionProblem problem = BuildProblem(30, 60, 0, 0, false, 4);
  for (int k = 1; k < 30; ++k) {
    for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
      ViewGraphEdge& edge = problem.graph.edges[e];
      if (!(edge.Pair() == ImagePair(k, k + 1))) continue;
      edge.length_m = problem.lengths[e]->length;
      edge.length_sigma_m = 0.01;
      edge.cam2_from_cam1.translation *= *edge.length_m;
    }
  }
  const GlobalPositions result = EstimateGlobalPositions(
      TranslationAveragingOptions(), problem.graph, problem.rotations, {}, {});
  ASSERT_TRUE(result.success);
  EXPECT_TRUE(result.metric);
  const AlignedErrors errors = Errors(problem, result.centers);
  EXPECT_LT(errors.rmse_m, 1e-2);
  EXPECT_NEAR(errors.scale, 1.0, 1e-2);
}

// Two halves whose only link is a camera at rest: image 15 of the one, image 16
// of the other, and many between them, without a direction to any other.
TEST(TranslationAveraging, ACameraAtRestJoinsBothSides) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    PositionProblem problem = BuildProblem(30, 60, 0, 0, false, seed);
    const Eigen::Vector3d step = problem.truth.at(16).TargetOriginInSource() -
                                 problem.truth.at(15).TargetOriginInSource();
    for (image_t k = 1; k <= 15; ++k) {
      problem.truth[k] = CamFromWorldWithCenter(
          problem.rotations[k], problem.truth[k].TargetOriginInSource() + step);
    }
    auto& edges = problem.graph.edges;
    for (size_t e = edges.size(); e-- > 0;) {
      if ((edges[e].image_id1 <= 15) == (edges[e].image_id2 <= 15)) continue;
      edges.erase(edges.begin() + e);
      problem.lengths.erase(problem.lengths.begin() + e);
    }
    const auto add_rest = [&problem](image_t id1, image_t id2) {
      ViewGraphEdge edge = BuildEdge(
          ImagePair(id1, id2),
          ComputeCam2FromCam1(problem.truth.at(id1), problem.truth.at(id2)));
      edge.has_baseline = false;
      edge.cam2_from_cam1.translation.setZero();
      problem.graph.edges.push_back(edge);
      problem.lengths.push_back(std::nullopt);
    };
    for (image_t k = 31; k <= 130; ++k) {
      problem.graph.images.push_back(k);
      problem.rotations[k] = problem.rotations.at(15);
      problem.truth[k] = problem.truth.at(15);
      add_rest(k == 31 ? 15 : k - 1, k);
      if (k > 32) add_rest(k - 2, k);
    }
    add_rest(16, 130);
    const GlobalPositions result =
        EstimateGlobalPositions(TranslationAveragingOptions(), problem.graph,
                                problem.rotations, problem.lengths, {});
    ASSERT_TRUE(result.success) << "seed " << seed;
    EXPECT_TRUE(result.converged) << "seed " << seed;
    const AlignedErrors errors = Errors(problem, result.centers);
    EXPECT_LT(errors.rmse_m, 1e-3) << "seed " << seed;
    // The unit is the median length of edges that move.
    std::vector<double> lengths;
    for (const std::optional<EdgeLength>& length : problem.lengths) {
      if (length) lengths.push_back(length->length);
    }
    EXPECT_NEAR(errors.scale, UpperMedian(&lengths), 1e-2 * errors.scale);
  }
}

TEST(TranslationAveraging, SolvesCollinearMotionThroughLengths) {
  const PositionProblem problem = BuildProblem(20, 40, 0.002, 0, true, 2);
  const GlobalPositions result =
      EstimateGlobalPositions(TranslationAveragingOptions(), problem.graph,
                              problem.rotations, problem.lengths, {});
  ASSERT_TRUE(result.success);
  EXPECT_LT(Errors(problem, result.centers).rmse_m, 0.05);
}

// With a quarter of wrong directions: no worse than the convex solution.
TEST(TranslationAveraging, IsAsGoodAsLeastUnsquaredDeviations) {
  double sum = 0.0;
  double sum_lud = 0.0;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const PositionProblem problem =
        BuildProblem(25, 200, 0.01, 0.25, false, seed);
    const GlobalPositions result =
        EstimateGlobalPositions(TranslationAveragingOptions(), problem.graph,
                                problem.rotations, problem.lengths, {});
    ASSERT_TRUE(result.success);
    sum += Errors(problem, result.centers).rmse_m;
    sum_lud += Errors(problem, SolveLud(problem)).rmse_m;
  }
  EXPECT_LT(sum, 1.05 * sum_lud);
  // Half a degree over some 5 m, averaged over a dozen edges.
  EXPECT_LT(sum / 5, 0.05);
}

// A straight drive, each image with the ten before it. The farthest of these
// pairs share too few points for a length, and a tenth of them err by 7 deg
// with a sigma of 0.1 deg.
TEST(TranslationAveraging, WrongDirectionsOfSmallSigmaDoNotOutvoteLengths) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    PositionProblem problem;
    for (int k = 1; k <= 60; ++k) {
      problem.graph.images.push_back(k);
      problem.rotations[k] = Eigen::Quaterniond::Identity();
      problem.truth[k] = CamFromWorldWithCenter(
          problem.rotations[k],
          Eigen::Vector3d(0, 0, k) + random.GaussianVector(0.02));
      for (int i = std::max(1, k - 10); i < k; ++i) {
        Rigid3d motion =
            ComputeCam2FromCam1(problem.truth.at(i), problem.truth.at(k));
        const double length = motion.translation.norm();
        const bool is_far = k - i >= 9;
        const bool is_wrong = is_far && random.Uniform(0, 1) < 0.1;
        const double noise_rad = is_wrong ? 0.12 : 0.003;
        motion.translation = ExpSo3(random.GaussianVector(noise_rad)) *
                             motion.translation.normalized();
        problem.graph.edges.push_back(BuildEdge(ImagePair(i, k), motion));
        problem.graph.edges.back().direction_sigma_rad =
            is_wrong ? 0.002 : 0.003;
        problem.lengths.push_back(std::nullopt);
        if (!is_far) {
          problem.lengths.back() =
              EdgeLength{length * (1.0 + random.Gaussian(0.03)), 0.03};
        }
      }
    }
    const GlobalPositions result =
        EstimateGlobalPositions(TranslationAveragingOptions(), problem.graph,
                                problem.rotations, problem.lengths, {});
    ASSERT_TRUE(result.success);
    const AlignedErrors errors = Errors(problem, result.centers);
    EXPECT_LT(errors.rmse_m, 0.1) << "seed " << seed;
  }
}

TEST(TranslationAveraging, IsNeverSilentAboutDisconnectedGraphs) {
  PositionProblem problem = BuildProblem(6, 0, 0, 0, false, 1);
  problem.graph.images.push_back(50);
  problem.rotations[50] = Eigen::Quaterniond::Identity();
  EXPECT_FALSE(EstimateGlobalPositions(TranslationAveragingOptions(),
                                       problem.graph, problem.rotations, {}, {})
                   .success);
}

// Along a line, without lengths and noise, the result must be finite.
TEST(TranslationAveraging, NeverReturnsNaN) {
  const PositionProblem problem = BuildProblem(20, 10, 0, 0.3, true, 3);
  const GlobalPositions result = EstimateGlobalPositions(
      TranslationAveragingOptions(), problem.graph, problem.rotations, {}, {});
  for (const auto& [image_id, center] : result.centers) {
    EXPECT_TRUE(center.allFinite());
  }
}

}  // namespace
}  // namespace adasfm
