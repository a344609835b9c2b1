// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace adasfm {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// The upper triangle of a symmetric matrix of 6x6 blocks, row by row.
struct BlockMatrix {
  // Of each row: sorted columns >= the row; the first is the diagonal.
  std::vector<std::vector<int>> columns;
  // The blocks, in the same order.
  std::vector<std::vector<Matrix6d>> blocks;

  int NumRows() const { return static_cast<int>(columns.size()); }
};

// L L^T = A for positive definite A of 6x6 blocks (the reduced camera system),
// with an approximate minimum degree order found once per structure. One
// thread; the same input gives the same bits.
class BlockCholesky {
 public:
  explicit BlockCholesky(const std::vector<std::vector<int>>& columns);

  // False when the matrix is not positive definite. The structure must be that
  // of the constructor.
  bool Factorize(const BlockMatrix& matrix);
  // After a successful factorisation.
  std::vector<Vector6d> Solve(const std::vector<Vector6d>& right_side) const;

 private:
  int num_rows_;
  std::vector<int> new_from_old_;
  // Of each column of L, in the new order: sorted rows; the first is the
  // diagonal.
  std::vector<std::vector<int>> rows_;
  std::vector<std::vector<Matrix6d>> factor_;
};

// Conjugate gradients with the diagonal blocks as preconditioner, until the
// residual has shrunk by `tolerance`. False when a diagonal block is not
// positive definite.
bool SolveIteratively(const BlockMatrix& matrix,
                      const std::vector<Vector6d>& right_side, double tolerance,
                      int max_num_iterations, std::vector<Vector6d>* solution);

}  // namespace adasfm
