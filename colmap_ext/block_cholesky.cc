// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/block_cholesky.h"

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

namespace adasfm {
namespace {

std::vector<int> FindEliminationOrder(
    const std::vector<std::vector<int>>& columns) {
  const int size = static_cast<int>(columns.size());
  std::vector<Eigen::Triplet<double, int>> entries;
  for (int row = 0; row < size; ++row) {
    for (const int column : columns[row]) {
      entries.emplace_back(row, column, 1.0);
      if (row != column) entries.emplace_back(column, row, 1.0);
    }
  }
  Eigen::SparseMatrix<double, Eigen::ColMajor, int> pattern(size, size);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> old_from_new;
  Eigen::AMDOrdering<int>()(pattern, old_from_new);
  std::vector<int> new_from_old(size);
  for (int i = 0; i < size; ++i) {
    new_from_old[old_from_new.indices()(i)] = i;
  }
  return new_from_old;
}

void Multiply(const BlockMatrix& matrix, const std::vector<Vector6d>& x,
              std::vector<Vector6d>* result) {
  for (Vector6d& block : *result) block.setZero();
  for (int row = 0; row < matrix.NumRows(); ++row) {
    for (size_t k = 0; k < matrix.columns[row].size(); ++k) {
      const int column = matrix.columns[row][k];
      const Matrix6d& block = matrix.blocks[row][k];
      (*result)[row].noalias() += block * x[column];
      if (row != column) {
        (*result)[column].noalias() += block.transpose() * x[row];
      }
    }
  }
}

double Dot(const std::vector<Vector6d>& a, const std::vector<Vector6d>& b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
  return sum;
}

}  // namespace

BlockCholesky::BlockCholesky(const std::vector<std::vector<int>>& columns)
    : num_rows_(static_cast<int>(columns.size())),
      new_from_old_(FindEliminationOrder(columns)),
      rows_(columns.size()),
      factor_(columns.size()) {
  for (int row = 0; row < num_rows_; ++row) {
    for (const int column : columns[row]) {
      const int a = new_from_old_[row];
      const int b = new_from_old_[column];
      rows_[std::min(a, b)].push_back(std::max(a, b));
    }
  }
  // A column's rows are also rows of its parent, the first below the diagonal.
  for (int column = 0; column < num_rows_; ++column) {
    std::vector<int>& rows = rows_[column];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    if (rows.size() > 1) {
      std::vector<int>& parent = rows_[rows[1]];
      parent.insert(parent.end(), rows.begin() + 1, rows.end());
    }
    factor_[column].resize(rows.size());
  }
}

bool BlockCholesky::Factorize(const BlockMatrix& matrix) {
  for (std::vector<Matrix6d>& column : factor_) {
    for (Matrix6d& block : column) block.setZero();
  }
  for (int row = 0; row < num_rows_; ++row) {
    for (size_t k = 0; k < matrix.columns[row].size(); ++k) {
      const int a = new_from_old_[row];
      const int b = new_from_old_[matrix.columns[row][k]];
      const std::vector<int>& rows = rows_[std::min(a, b)];
      const size_t position =
          std::lower_bound(rows.begin(), rows.end(), std::max(a, b)) -
          rows.begin();
      // Stored below the diagonal: block (max, min).
      Matrix6d& target = factor_[std::min(a, b)][position];
      if (a > b) {
        target = matrix.blocks[row][k];
      } else {
        target = matrix.blocks[row][k].transpose();
      }
    }
  }
  for (int column = 0; column < num_rows_; ++column) {
    const std::vector<int>& rows = rows_[column];
    std::vector<Matrix6d>& blocks = factor_[column];
    const Eigen::LLT<Matrix6d> diagonal(blocks[0]);
    if (diagonal.info() != Eigen::Success) return false;
    blocks[0] = diagonal.matrixL();
    if (!(blocks[0].diagonal().minCoeff() > 0.0) || !blocks[0].allFinite()) {
      return false;
    }
    for (size_t i = 1; i < rows.size(); ++i) {
      blocks[i] = diagonal.matrixL().solve(blocks[i].transpose()).transpose();
    }
    for (size_t k = 1; k < rows.size(); ++k) {
      const std::vector<int>& target_rows = rows_[rows[k]];
      std::vector<Matrix6d>& target = factor_[rows[k]];
      size_t position = 0;
      for (size_t i = k; i < rows.size(); ++i) {
        while (target_rows[position] != rows[i]) ++position;
        target[position].noalias() -= blocks[i] * blocks[k].transpose();
      }
    }
  }
  return true;
}

std::vector<Vector6d> BlockCholesky::Solve(
    const std::vector<Vector6d>& right_side) const {
  std::vector<Vector6d> x(num_rows_);
  for (int i = 0; i < num_rows_; ++i) x[new_from_old_[i]] = right_side[i];
  for (int column = 0; column < num_rows_; ++column) {
    x[column] =
        factor_[column][0].triangularView<Eigen::Lower>().solve(x[column]);
    for (size_t i = 1; i < rows_[column].size(); ++i) {
      x[rows_[column][i]].noalias() -= factor_[column][i] * x[column];
    }
  }
  for (int column = num_rows_ - 1; column >= 0; --column) {
    for (size_t i = 1; i < rows_[column].size(); ++i) {
      x[column].noalias() -=
          factor_[column][i].transpose() * x[rows_[column][i]];
    }
    x[column] =
        factor_[column][0].transpose().triangularView<Eigen::Upper>().solve(
            x[column]);
  }
  std::vector<Vector6d> solution(num_rows_);
  for (int i = 0; i < num_rows_; ++i) solution[i] = x[new_from_old_[i]];
  return solution;
}

bool SolveIteratively(const BlockMatrix& matrix,
                      const std::vector<Vector6d>& right_side, double tolerance,
                      int max_num_iterations, std::vector<Vector6d>* solution) {
  const int size = matrix.NumRows();
  std::vector<Eigen::LLT<Matrix6d>> preconditioner(size);
  for (int i = 0; i < size; ++i) {
    preconditioner[i].compute(matrix.blocks[i][0]);
    if (preconditioner[i].info() != Eigen::Success) return false;
  }
  const auto precondition = [&](const std::vector<Vector6d>& residual) {
    std::vector<Vector6d> result(size);
    for (int i = 0; i < size; ++i) {
      result[i] = preconditioner[i].solve(residual[i]);
    }
    return result;
  };
  solution->assign(size, Vector6d::Zero());
  std::vector<Vector6d> residual = right_side;
  std::vector<Vector6d> conditioned = precondition(residual);
  std::vector<Vector6d> direction = conditioned;
  std::vector<Vector6d> product(size);
  double energy = Dot(residual, conditioned);
  const double target = tolerance * tolerance * energy;
  for (int iteration = 0; iteration < max_num_iterations && energy > target;
       ++iteration) {
    Multiply(matrix, direction, &product);
    const double curvature = Dot(direction, product);
    if (!(curvature > 0.0)) break;
    const double step = energy / curvature;
    for (int i = 0; i < size; ++i) {
      (*solution)[i] += step * direction[i];
      residual[i] -= step * product[i];
    }
    conditioned = precondition(residual);
    const double new_energy = Dot(residual, conditioned);
    for (int i = 0; i < size; ++i) {
      direction[i] = conditioned[i] + new_energy / energy * direction[i];
    }
    energy = new_energy;
  }
  return true;
}

}  // namespace adasfm
