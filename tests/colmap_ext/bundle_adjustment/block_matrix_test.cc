// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/block_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace adasfm {
namespace {

TEST(BlockMatrixTest, AddsBlocksIntoTheLowerTriangle) {
  BlockMatrix matrix;
  for (const int size : {6, 3, 2}) matrix.AddBlock(size);
  // More than once, and from either side.
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

}  // namespace
}  // namespace adasfm
