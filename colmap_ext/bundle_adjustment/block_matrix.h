// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

namespace adasfm {

// A symmetric sparse matrix as a sum of dense blocks, of which the lower
// triangle is kept. Its pattern is known before its values, so that nothing but
// the matrix itself takes memory: AddBlock, then AddPair, then Reorder, then
// Allocate.
class BlockMatrix {
 public:
  // Appends rows and columns; the index of the block.
  int AddBlock(int size);
  int NumBlocks() const { return static_cast<int>(size_.size()); }
  int NumColumns() const { return num_columns_; }
  int SizeOf(int block) const { return size_[block]; }
  int FirstColumnOf(int block) const { return first_[block]; }

  // Makes room for what two blocks have in common, if there is none yet.
  void AddPair(int block1, int block2);
  // Numbers the blocks anew so that a Cholesky factor has little fill
  // (block_ordering.h); the new number of each. A graph of blocks takes a 36th
  // of the memory of that of a matrix of poses, and a matrix in order is
  // factorised without a copy (ordered_cholesky.h).
  std::vector<int> Reorder();
  // Fixes the pattern; all values are zero.
  void Allocate();

  // Adds to the rows of one block and the columns of one not behind it; of the
  // block of a diagonal the lower triangle. Other columns may be added to at
  // the same time.
  template <typename Derived>
  void Add(int row_block, int col_block,
           const Eigen::MatrixBase<Derived>& values) {
    constexpr int kNumRows = Derived::RowsAtCompileTime;
    using Column = Eigen::Matrix<double, kNumRows, 1>;
    const bool is_diagonal = row_block == col_block;
    const int offset = is_diagonal ? 0 : OffsetOf(row_block, col_block);
    for (int col = 0; col < values.cols(); ++col) {
      double* start =
          matrix_.valuePtr() + matrix_.outerIndexPtr()[first_[col_block] + col];
      if (is_diagonal) {
        for (int row = col; row < values.rows(); ++row) {
          start[row - col] += values(row, col);
        }
      } else {
        start += size_[col_block] - col + offset;
        Eigen::Map<Column>(start, values.rows()) += values.col(col);
      }
    }
  }

  // The blocks below the diagonal of a column of blocks, ascending.
  const std::vector<int>& RowsOf(int col_block) const {
    return columns_[col_block].rows;
  }
  // Adds to the k-th of RowsOf a block of two factors, kNumRows x 3 and
  // 3 x kNumCols: without a search, for many additions to one column.
  template <int kNumRows, int kNumCols>
  void AddProduct(int col_block, int k,
                  const Eigen::Matrix<double, kNumRows, 3>& left,
                  const Eigen::Matrix<double, 3, kNumCols>& right) {
    const int offset = offsets_[col_block][k];
    const int* begin = matrix_.outerIndexPtr() + first_[col_block];
    for (int col = 0; col < kNumCols; ++col) {
      double* start = matrix_.valuePtr() + begin[col] + kNumCols - col + offset;
      Eigen::Map<Eigen::Matrix<double, kNumRows, 1>>(start).noalias() +=
          left * right.col(col);
    }
  }

  const Eigen::SparseMatrix<double>& Matrix() const { return matrix_; }
  Eigen::SparseMatrix<double>& Matrix() { return matrix_; }

 private:
  // Of one column of blocks: those below the diagonal.
  struct Column {
    std::vector<int> rows;
    // Sorted and unique so far.
    size_t num_sorted = 0;
    void Sort();
  };

  // Where the rows of a block begin behind those of the diagonal.
  int OffsetOf(int row_block, int col_block) const;

  std::vector<int> size_;
  std::vector<int> first_;
  int num_columns_ = 0;
  std::vector<Column> columns_;
  // By column, one for each of its rows.
  std::vector<std::vector<int>> offsets_;
  Eigen::SparseMatrix<double> matrix_;
};

}  // namespace adasfm
