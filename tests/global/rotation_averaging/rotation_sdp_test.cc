// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/rotation_sdp.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "core/random.h"
#include "core/so3.h"
#include "global/rotation_averaging/rotation_certificate.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

struct SdpProblem {
  std::vector<Eigen::Matrix3d> truth;
  std::vector<RotationEdge> edges;
};

SdpProblem BuildProblem(int num_nodes, int num_chords, double noise_rad,
                        double outlier_ratio, uint64_t seed) {
  Random random(seed);
  SdpProblem problem;
  for (int i = 0; i < num_nodes; ++i) {
    problem.truth.push_back(ExpSo3(random.UnitVector() * random.Uniform(0, kPi))
                                .toRotationMatrix());
  }
  for (const ImagePair& pair :
       BuildRandomPairs(num_nodes, num_chords, &random)) {
    RotationEdge edge;
    edge.i = pair.image_id1 - 1;
    edge.j = pair.image_id2 - 1;
    edge.sigma_rad = random.Uniform(0.5, 2.0) * std::max(1e-3, noise_rad);
    edge.rotation =
        ExpSo3(random.GaussianVector(noise_rad)).toRotationMatrix() *
        problem.truth[edge.j] * problem.truth[edge.i].transpose();
    if (random.Uniform(0, 1) < outlier_ratio) {
      edge.rotation = ExpSo3(random.UnitVector() * random.Uniform(0.5, kPi))
                          .toRotationMatrix();
    }
    problem.edges.push_back(edge);
  }
  return problem;
}

std::vector<RotationBlock> BlocksOf(
    const std::vector<Eigen::Matrix3d>& rotations) {
  return {rotations.begin(), rotations.end()};
}

std::vector<Eigen::Matrix3d> RandomRotations(size_t size, Random* random) {
  std::vector<Eigen::Matrix3d> rotations;
  for (size_t i = 0; i < size; ++i) {
    rotations.push_back(ExpSo3(random->UnitVector() * random->Uniform(0, kPi))
                            .toRotationMatrix());
  }
  return rotations;
}

TEST(BoundNegativeEigenvalue, HoldsAndIsTightAgainstADenseSolver) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const int size = random.UniformInt(1, 40);
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
    for (int k = 0; k < 3 * size; ++k) {
      const int i = random.UniformInt(0, size - 1);
      const int j = random.UniformInt(0, size - 1);
      dense(i, j) = dense(j, i) = random.Gaussian(1.0);
    }
    const double smallest =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(dense).eigenvalues()(0);
    const Eigen::SparseMatrix<double> lower =
        Eigen::MatrixXd(dense.triangularView<Eigen::Lower>()).sparseView();
    for (const double guess : {0.0, 0.9 * std::max(0.0, -smallest)}) {
      const double bound = BoundNegativeEigenvalue(lower, guess);
      EXPECT_GE(bound, -smallest) << "seed " << seed;
      // The search doubles its bound.
      EXPECT_LE(bound, 2.0 * std::max(0.0, -smallest) + 1e-9);
    }
  }
}

TEST(BoundNegativeEigenvalue, EndsOnAnything) {
  EXPECT_EQ(BoundNegativeEigenvalue(Eigen::SparseMatrix<double>(), 0.0), 0.0);
  Eigen::SparseMatrix<double> matrix(2, 2);
  EXPECT_EQ(BoundNegativeEigenvalue(matrix, 0.0), 0.0);
  matrix.insert(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isinf(BoundNegativeEigenvalue(matrix, 0.0)));
}

// Cost(Z) = Cost(Y) + <S(Y), Z Z^T> for all Y and Z with orthonormal rows, on
// which the bound rests.
TEST(CertificateMatrix, RelatesTheCostsOfAnyTwoSolutions) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const SdpProblem input = BuildProblem(9, 8, 0.05, 0.2, seed);
    const RotationSdpProblem problem(input.edges, input.truth.size());
    Random random(seed);
    const auto y = BlocksOf(RandomRotations(9, &random));
    const auto z = BlocksOf(RandomRotations(9, &random));
    Eigen::MatrixXd stacked(27, 3);
    for (int i = 0; i < 9; ++i) stacked.middleRows<3>(3 * i) = z[i];
    const Eigen::SparseMatrix<double> certificate =
        CertificateMatrix(problem, y);
    const Eigen::MatrixXd product =
        certificate.selfadjointView<Eigen::Lower>() * stacked;
    EXPECT_NEAR(problem.Cost(z),
                problem.Cost(y) + stacked.cwiseProduct(product).sum(), 1e-9);
  }
}

TEST(SolveRotationSdp, CertifiesGlobalOptimaFromAnyStart) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const SdpProblem problem = BuildProblem(25, 50, 0.02, 0.0, seed);
    Random random(seed);
    RotationSdpOptions options;
    options.max_num_sweeps = 2000;
    options.tolerance = 1e-10;
    options.max_rank = 12;
    const RotationSdpSolution solution =
        SolveRotationSdp(options, problem.edges, RandomRotations(25, &random));
    EXPECT_GT(solution.optimality, 0.99) << "seed " << seed;
    EXPECT_LE(solution.optimality, 1.0);
  }
}

// Wrong edges or not: no rotations cost less than the bound.
TEST(SolveRotationSdp, BoundsTheCostOfAllRotations) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const double outlier_ratio = 0.06 * seed;
    const SdpProblem problem = BuildProblem(12, 30, 0.02, outlier_ratio, seed);
    const RotationSdpProblem costs(problem.edges, problem.truth.size());
    Random random(seed);
    RotationSdpOptions options;
    // Even seeds stop long before the optimum.
    options.max_num_sweeps = seed % 2 == 0 ? 2 : 500;
    const RotationSdpSolution solution =
        SolveRotationSdp(options, problem.edges, RandomRotations(12, &random));
    EXPECT_LE(solution.lower_bound, solution.cost);
    EXPECT_LE(solution.lower_bound, costs.Cost(BlocksOf(problem.truth)));
    const double rounded_cost = costs.Cost(BlocksOf(solution.rotations));
    EXPECT_LE(solution.lower_bound, rounded_cost);
    EXPECT_NEAR(solution.optimality, solution.lower_bound / rounded_cost, 1e-9);
    // Descent from the rounded solution and from the truth cannot go below.
    for (const auto& start : {solution.rotations, problem.truth}) {
      RotationSdpOptions fixed_rank;
      fixed_rank.max_rank = 3;
      const auto descended = SolveRotationSdp(fixed_rank, problem.edges, start);
      EXPECT_LE(solution.lower_bound, descended.cost * (1.0 + 1e-9));
    }
  }
}

}  // namespace
}  // namespace adasfm
