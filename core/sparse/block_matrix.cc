// SPDX-License-Identifier: BSD-3-Clause
#include "core/sparse/block_matrix.h"

#include <algorithm>
#include <utility>

#include "core/sparse/block_ordering.h"
#include "core/sparse/huge_pages.h"

namespace adasfm {

int BlockMatrix::AddBlock(int size) {
  first_.push_back(num_columns_);
  size_.push_back(size);
  columns_.emplace_back();
  num_columns_ += size;
  return NumBlocks() - 1;
}

void BlockMatrix::Column::Sort() {
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  num_sorted = rows.size();
}

void BlockMatrix::AddPair(int block1, int block2) {
  if (block1 == block2) return;
  // Priors, and points in the Ceres problem, repeat the same pairs many times.
  // Repetitions are removed before they double the list.
  constexpr size_t kMinNumUnsorted = 64;
  Column& column = columns_[std::min(block1, block2)];
  column.rows.push_back(std::max(block1, block2));
  if (column.rows.size() > 2 * column.num_sorted + kMinNumUnsorted) {
    column.Sort();
  }
}

std::vector<int> BlockMatrix::Reorder() {
  std::vector<std::vector<int>> rows_of;
  for (Column& column : columns_) {
    column.Sort();
    rows_of.push_back(column.rows);
  }
  const BlockOrdering ordering = FindBlockOrdering(rows_of);
  std::vector<int> number_of(NumBlocks());
  BlockMatrix ordered;
  for (int number = 0; number < NumBlocks(); ++number) {
    const int block = ordering.block_of_number[number];
    number_of[block] = ordered.AddBlock(size_[block]);
  }
  for (int block = 0; block < NumBlocks(); ++block) {
    for (const int other : columns_[block].rows) {
      ordered.AddPair(number_of[block], number_of[other]);
    }
  }
  *this = std::move(ordered);
  return number_of;
}

void BlockMatrix::Allocate() {
  offsets_.assign(NumBlocks(), {});
  Eigen::VectorXi num_rows(num_columns_);
  for (int block = 0; block < NumBlocks(); ++block) {
    columns_[block].Sort();
    columns_[block].rows.shrink_to_fit();
    int num_below = 0;
    for (const int row : columns_[block].rows) {
      offsets_[block].push_back(num_below);
      num_below += size_[row];
    }
    for (int col = 0; col < size_[block]; ++col) {
      num_rows[first_[block] + col] = size_[block] - col + num_below;
    }
  }
  matrix_.resize(num_columns_, num_columns_);
  matrix_.resizeNonZeros(num_rows.sum());
  AdviseHugePages(matrix_.valuePtr(), matrix_.nonZeros() * sizeof(double));
  int next = 0;
  for (int block = 0; block < NumBlocks(); ++block) {
    for (int col = first_[block]; col < first_[block] + size_[block]; ++col) {
      matrix_.outerIndexPtr()[col] = next;
      const auto add_rows = [&](int begin, int end) {
        for (int row = begin; row < end; ++row) {
          matrix_.innerIndexPtr()[next++] = row;
        }
      };
      add_rows(col, first_[block] + size_[block]);
      for (const int row : columns_[block].rows) {
        add_rows(first_[row], first_[row] + size_[row]);
      }
    }
  }
  matrix_.outerIndexPtr()[num_columns_] = next;
  matrix_.coeffs().setZero();
}

int BlockMatrix::OffsetOf(int row_block, int col_block) const {
  const std::vector<int>& rows = columns_[col_block].rows;
  const auto row = std::lower_bound(rows.begin(), rows.end(), row_block);
  return offsets_[col_block][row - rows.begin()];
}

}  // namespace adasfm
