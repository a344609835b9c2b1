// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/block_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "core/random.h"

namespace adasfm {
namespace {

// A chain with some loops, positive definite.
BlockMatrix RandomBlockMatrix(int num_rows, uint64_t seed) {
  Random random(seed);
  BlockMatrix matrix;
  matrix.columns.resize(num_rows);
  matrix.blocks.resize(num_rows);
  for (int row = 0; row < num_rows; ++row) {
    for (int column = row; column < num_rows; ++column) {
      const bool is_loop = random.Uniform(0.0, 1.0) < 0.1;
      if (column - row > 2 && !is_loop) continue;
      Matrix6d block;
      for (int k = 0; k < 36; ++k) block(k) = random.Uniform(-1.0, 1.0);
      if (row == column) {
        block = (block * block.transpose()).eval();
        block.diagonal().array() += 6.0 * num_rows;
      }
      matrix.columns[row].push_back(column);
      matrix.blocks[row].push_back(block);
    }
  }
  return matrix;
}

Eigen::MatrixXd ToDense(const BlockMatrix& matrix) {
  const int size = 6 * matrix.NumRows();
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
  for (int row = 0; row < matrix.NumRows(); ++row) {
    for (size_t k = 0; k < matrix.columns[row].size(); ++k) {
      const int column = matrix.columns[row][k];
      dense.block<6, 6>(6 * column, 6 * row) =
          matrix.blocks[row][k].transpose();
      dense.block<6, 6>(6 * row, 6 * column) = matrix.blocks[row][k];
    }
  }
  return dense;
}

class BlockCholeskyTest : public testing::TestWithParam<int> {};

TEST_P(BlockCholeskyTest, SolvesAsADenseSolverDoes) {
  for (const uint64_t seed : {1, 2, 3}) {
    const BlockMatrix matrix = RandomBlockMatrix(GetParam(), seed);
    Random random(seed);
    Eigen::VectorXd right_side(6 * matrix.NumRows());
    for (double& value : right_side) value = random.Gaussian(1.0);
    std::vector<Vector6d> blocks;
    for (int i = 0; i < matrix.NumRows(); ++i) {
      blocks.push_back(right_side.segment<6>(6 * i));
    }
    const Eigen::VectorXd expected = ToDense(matrix).llt().solve(right_side);

    BlockCholesky cholesky(matrix.columns);
    ASSERT_TRUE(cholesky.Factorize(matrix));
    const std::vector<Vector6d> direct = cholesky.Solve(blocks);
    std::vector<Vector6d> iterative;
    ASSERT_TRUE(SolveIteratively(matrix, blocks, 1e-12, 1000, &iterative));
    for (int i = 0; i < matrix.NumRows(); ++i) {
      EXPECT_LT((direct[i] - expected.segment<6>(6 * i)).norm(),
                1e-10 * expected.norm());
      EXPECT_LT((iterative[i] - expected.segment<6>(6 * i)).norm(),
                1e-8 * expected.norm());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, BlockCholeskyTest,
                         testing::Values(1, 2, 7, 40));

TEST(BlockCholeskyFailureTest, RefusesAnIndefiniteMatrix) {
  BlockMatrix matrix = RandomBlockMatrix(5, 1);
  matrix.blocks[3][0](2, 2) = -1.0;
  EXPECT_FALSE(BlockCholesky(matrix.columns).Factorize(matrix));
}

}  // namespace
}  // namespace adasfm
