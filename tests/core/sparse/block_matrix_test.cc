// SPDX-License-Identifier: BSD-3-Clause
#include "core/sparse/block_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

namespace adasfm {
namespace {

TEST(BlockMatrixTest, AddsBlocksIntoTheLowerTriangle) {
  BlockMatrix matrix;
  for (const int size : {6, 3, 2}) matrix.AddBlock(size);
  // More than once, and in either order.
  for (int k = 0; k < 1000; ++k)
    matrix.AddPair(k % 2 == 0 ? 0 : 2, 2 - k % 2 * 2);
  matrix.Allocate();
  EXPECT_EQ(matrix.Matrix().nonZeros(), 21 + 6 + 3 + 2 * 6);
  const Eigen::MatrixXd corner = Eigen::MatrixXd::Random(2, 6);
  const Eigen::Matrix3d middle = Eigen::Matrix3d::Random();
  matrix.Add(2, 0, corner);
  matrix.Add(2, 0, corner);
  matrix.Add(1, 1, middle);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(11, 11);
  expected.block(9, 0, 2, 6) = 2.0 * corner;
  expected.block(6, 6, 3, 3) = middle.triangularView<Eigen::Lower>();
  EXPECT_LT((Eigen::MatrixXd(matrix.Matrix()) - expected).norm(), 1e-15);
}

// Values below the diagonal of the Cholesky factor, without CHOLMOD.
int CountFill(const Eigen::SparseMatrix<double>& lower) {
  Eigen::MatrixXd pattern = lower;
  int num_values = 0;
  for (int col = 0; col < pattern.cols(); ++col) {
    std::vector<int> rows;
    for (int row = col + 1; row < pattern.rows(); ++row) {
      if (pattern(row, col) != 0.0) rows.push_back(row);
    }
    for (const int a : rows) {
      for (const int b : rows) pattern(std::max(a, b), std::min(a, b)) = 1.0;
    }
    num_values += static_cast<int>(rows.size());
  }
  return num_values;
}

// Block 0 is connected to all others, a chain 1 - 2 - ... - 39. Eliminated
// first, it would connect all blocks.
TEST(BlockMatrixTest, ReordersWithoutFill) {
  constexpr int kNumBlocks = 40;
  BlockMatrix matrix;
  for (int block = 0; block < kNumBlocks; ++block) {
    matrix.AddBlock(block == 0 ? 2 : 6);
  }
  for (int block = 1; block < kNumBlocks; ++block) {
    matrix.AddPair(0, block);
    if (block > 1) matrix.AddPair(block, block - 1);
  }
  const std::vector<int> number_of = matrix.Reorder();
  std::vector<int> sorted = number_of;
  std::sort(sorted.begin(), sorted.end());
  for (int block = 0; block < kNumBlocks; ++block) {
    EXPECT_EQ(sorted[block], block);
    EXPECT_EQ(matrix.SizeOf(number_of[block]), block == 0 ? 2 : 6);
  }
  matrix.Allocate();
  const Eigen::MatrixXd link = Eigen::MatrixXd::Random(6, 6);
  const Eigen::MatrixXd to_first = Eigen::MatrixXd::Random(6, 2);
  Eigen::MatrixXd expected =
      Eigen::MatrixXd::Zero(matrix.NumColumns(), matrix.NumColumns());
  const auto add = [&](int block1, int block2, const Eigen::MatrixXd& values) {
    const int row = number_of[block1];
    const int col = number_of[block2];
    if (row < col) {
      matrix.Add(col, row, values.transpose().eval());
    } else {
      matrix.Add(row, col, values);
    }
    const int first_row = matrix.FirstColumnOf(row);
    const int first_col = matrix.FirstColumnOf(col);
    expected.block(first_row, first_col, values.rows(), values.cols()) = values;
    expected.block(first_col, first_row, values.cols(), values.rows()) =
        values.transpose();
  };
  for (int block = 0; block < kNumBlocks; ++block) {
    const int size = block == 0 ? 2 : 6;
    add(block, block, Eigen::MatrixXd::Ones(size, size));
    if (block > 0) add(block, 0, to_first);
    if (block > 1) add(block, block - 1, link);
  }
  EXPECT_EQ(Eigen::MatrixXd(matrix.Matrix()),
            Eigen::MatrixXd(expected.triangularView<Eigen::Lower>()));
  EXPECT_EQ(CountFill(matrix.Matrix()),
            matrix.Matrix().nonZeros() - matrix.NumColumns());
}

}  // namespace
}  // namespace adasfm
