// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/laplacian_solver.h"

#include <algorithm>
#include <stdexcept>

#include "core/sparse/ordered_cholesky.h"

namespace adasfm {

LaplacianSolver::LaplacianSolver(int num_nodes,
                                 std::vector<std::pair<int, int>> edges)
    : num_nodes_(num_nodes),
      edges_(std::move(edges)),
      factorization_(std::make_unique<OrderedCholesky>()) {
  for (int node = 1; node < num_nodes; ++node) laplacian_.AddBlock(1);
  for (const auto& [i, j] : edges_) {
    if (i < 0 || j < 0 || i >= num_nodes || j >= num_nodes || i == j) {
      throw std::invalid_argument("LaplacianSolver: edge out of range");
    }
    if (i > 0 && j > 0) laplacian_.AddPair(i - 1, j - 1);
  }
  if (num_nodes < 2) return;
  row_of_ = laplacian_.Reorder();
  laplacian_.Allocate();
  factorization_->analyzePattern(laplacian_.Matrix());
}

LaplacianSolver::~LaplacianSolver() = default;

bool LaplacianSolver::Solve(const std::vector<double>& weights,
                            const Vectors& differences, Vectors* nodes) {
  if (num_nodes_ == 0) return false;
  Vectors right_side = Vectors::Zero(num_nodes_ - 1, 3);
  double max_weight = 0.0;
  for (size_t e = 0; e < edges_.size(); ++e) {
    const auto [i, j] = edges_[e];
    const Eigen::RowVector3d flow = weights[e] * differences.row(e);
    if (i > 0) right_side.row(RowOf(i)) -= flow;
    if (j > 0) right_side.row(RowOf(j)) += flow;
    max_weight = std::max(max_weight, weights[e]);
  }
  Vectors solution;
  // The ridge is far below the weakest useful weight: long chains of weak
  // edges keep their shape.
  for (const double ridge : {0.0, 1e-13, 1e-10}) {
    if (SolveWithRidge(weights, right_side, ridge * max_weight, &solution)) {
      nodes->resize(num_nodes_, 3);
      nodes->row(0).setZero();
      for (int node = 1; node < num_nodes_; ++node) {
        nodes->row(node) = solution.row(RowOf(node));
      }
      return true;
    }
  }
  return false;
}

void LaplacianSolver::Add(int row, int col, double value) {
  laplacian_.Add(row, col, Eigen::Matrix<double, 1, 1>(value));
}

bool LaplacianSolver::SolveWithRidge(const std::vector<double>& weights,
                                     const Vectors& right_side, double ridge,
                                     Vectors* solution) {
  const int size = num_nodes_ - 1;
  if (size == 0) {
    solution->resize(0, 3);
    return true;
  }
  laplacian_.Matrix().coeffs().setZero();
  for (int row = 0; row < size; ++row) Add(row, row, ridge);
  for (size_t e = 0; e < edges_.size(); ++e) {
    const auto [i, j] = edges_[e];
    if (i > 0) Add(RowOf(i), RowOf(i), weights[e]);
    if (j > 0) Add(RowOf(j), RowOf(j), weights[e]);
    if (i == 0 || j == 0) continue;
    Add(std::max(RowOf(i), RowOf(j)), std::min(RowOf(i), RowOf(j)),
        -weights[e]);
  }
  factorization_->factorize(laplacian_.Matrix());
  if (factorization_->info() != Eigen::Success) return false;
  if (!(factorization_->ReciprocalCondition() > 1e-14)) return false;
  *solution = factorization_->solve(right_side);
  return solution->allFinite();
}

}  // namespace adasfm
