// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

namespace adasfm {

// A symmetric sparse matrix that is a sum of dense blocks; only the lower
// triangle is stored. The pattern is fixed before the values, so that only the
// matrix itself takes memory. Order of calls: AddBlock, AddPair, Reorder,
// Allocate.
class BlockMatrix {
 public:
  // Appends a block of `size` rows and columns; returns its index.
  int AddBlock(int size);
  int NumBlocks() const { return static_cast<int>(size_.size()); }
  int NumColumns() const { return num_columns_; }
  int SizeOf(int block) const { return size_[block]; }
  int FirstColumnOf(int block) const { return first_[block]; }

  // Makes room for the block of a pair, unless it exists.
  void AddPair(int block1, int block2);
  // Renumbers the blocks so that a Cholesky factor has little fill
  // (block_ordering.h); returns the new number of each. For a matrix of poses
  // the graph of blocks takes a 36th of the memory of the graph of numbers. An
  // ordered matrix is factorised without a copy (ordered_cholesky.h).
  std::vector<int> Reorder();
  // Fixes the pattern; all values are zero.
  void Allocate();

  // Adds `values` to a block, row_block >= col_block; to a block of the
  // diagonal only their lower triangle. Threads may add to different columns at
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
  // Adds a product of two factors, kNumRows x 3 and 3 x kNumCols, to the k-th
  // of RowsOf. Without a search, for many additions to one column.
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
  // The blocks below the diagonal in one column of blocks.
  struct Column {
    std::vector<int> rows;
    // So many of the first rows are sorted and unique.
    size_t num_sorted = 0;
    void Sort();
  };

  // Where the rows of a block begin behind those of the diagonal block.
  int OffsetOf(int row_block, int col_block) const;

  std::vector<int> size_;
  std::vector<int> first_;
  int num_columns_ = 0;
  std::vector<Column> columns_;
  // OffsetOf for each of RowsOf, by column.
  std::vector<std::vector<int>> offsets_;
  Eigen::SparseMatrix<double> matrix_;
};

}  // namespace adasfm
