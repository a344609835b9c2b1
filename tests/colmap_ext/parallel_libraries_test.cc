// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <omp.h>

#include <Eigen/Core>
#include <atomic>
#include <random>
#include <vector>

#include "core/parallel.h"
#include "core/sparse/ordered_cholesky.h"

namespace adasfm {
namespace {

// A positive definite matrix without zeros: one supernode.
Eigen::SparseMatrix<double> MakeMatrix(int size, int seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd root =
      Eigen::MatrixXd::NullaryExpr(size, size, [&] { return normal(random); });
  const Eigen::MatrixXd matrix =
      root * root.transpose() + size * Eigen::MatrixXd::Identity(size, size);
  return matrix.sparseView();
}

// With Debian's OpenBLAS without locks 3 of the first 20,000 factorisations
// were wrong.
TEST(ParallelLibraries, FactorisationsSideBySideAreThoseOfOneThread) {
  constexpr int kSize = 96;
  constexpr int kNumMatrices = 4;
  constexpr int kNumRepetitions = 20000;
  std::vector<Eigen::SparseMatrix<double>> matrices;
  std::vector<Eigen::VectorXd> solutions;
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(kSize);
  for (int i = 0; i < kNumMatrices; ++i) {
    matrices.push_back(MakeMatrix(kSize, i));
    const OneOpenMpThread one_thread;
    OrderedCholesky factor;
    factor.analyzePattern(matrices[i]);
    factor.factorize(matrices[i]);
    solutions.push_back(factor.solve(ones));
    EXPECT_LT((matrices[i] * solutions[i] - ones).norm(), 1e-9);
  }
  std::atomic<int> num_wrong{0};
  ParallelFor(kNumMatrices, kNumMatrices, [&](size_t i) {
    OrderedCholesky factor;
    factor.analyzePattern(matrices[i]);
    for (int k = 0; k < kNumRepetitions; ++k) {
      factor.factorize(matrices[i]);
      if (factor.solve(ones) != solutions[i]) ++num_wrong;
    }
  });
  EXPECT_EQ(num_wrong, 0) << "of " << kNumMatrices * kNumRepetitions;
}

// Even loops that ask for a number of threads, as in CHOLMOD.
TEST(ParallelLibraries, OpenMpLoopsStayOnTheThreadsOfParallelFor) {
  omp_set_num_threads(3);
  const int max_active_levels = omp_get_max_active_levels();
  for (const int num_threads : {1, 4}) {
    std::vector<int> sizes(4, 0);
    ParallelFor(num_threads, sizes.size(), [&](size_t i) {
      EXPECT_EQ(omp_get_max_threads(), 1);
#pragma omp parallel num_threads(4)
#pragma omp single
      sizes[i] = omp_get_num_threads();
    });
    EXPECT_EQ(sizes, std::vector<int>(4, 1));
    EXPECT_EQ(omp_get_max_threads(), 3);
    EXPECT_EQ(omp_get_max_active_levels(), max_active_levels);
  }
}

TEST(ParallelLibraries, BlasIsSafe) { EXPECT_TRUE(IsBlasSafeInThreads()); }

}  // namespace
}  // namespace adasfm
