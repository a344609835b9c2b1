// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/laplacian_solver.h"

#include <stdexcept>

namespace adasfm {

LaplacianSolver::LaplacianSolver(int num_nodes,
                                 std::vector<std::pair<int, int>> edges)
    : num_nodes_(num_nodes), edges_(std::move(edges)) {
  for (const auto& [i, j] : edges_) {
    if (i < 0 || j < 0 || i >= num_nodes || j >= num_nodes || i == j) {
      throw std::invalid_argument("LaplacianSolver: edge out of range");
    }
  }
}

bool LaplacianSolver::Solve(const std::vector<double>& weights,
                            const Vectors& differences, Vectors* nodes) {
  if (num_nodes_ == 0) return false;
  Vectors right_side = Vectors::Zero(num_nodes_ - 1, 3);
  double max_weight = 0.0;
  for (size_t e = 0; e < edges_.size(); ++e) {
    const auto [i, j] = edges_[e];
    if (i > 0) right_side.row(i - 1) -= weights[e] * differences.row(e);
    if (j > 0) right_side.row(j - 1) += weights[e] * differences.row(e);
    max_weight = std::max(max_weight, weights[e]);
  }
  Vectors solution;
  // The ridge is far below the weakest useful weight: long chains of weak
  // edges keep their shape.
  for (const double ridge : {0.0, 1e-13, 1e-10}) {
    if (SolveWithRidge(weights, right_side, ridge * max_weight, &solution)) {
      nodes->resize(num_nodes_, 3);
      nodes->row(0).setZero();
      nodes->bottomRows(num_nodes_ - 1) = solution;
      return true;
    }
  }
  return false;
}

bool LaplacianSolver::SolveWithRidge(const std::vector<double>& weights,
                                     const Vectors& right_side, double ridge,
                                     Vectors* solution) {
  const int size = num_nodes_ - 1;
  if (size == 0) {
    solution->resize(0, 3);
    return true;
  }
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(3 * edges_.size() + size);
  for (int i = 0; i < size; ++i) triplets.emplace_back(i, i, ridge);
  for (size_t e = 0; e < edges_.size(); ++e) {
    const int i = std::min(edges_[e].first, edges_[e].second) - 1;
    const int j = std::max(edges_[e].first, edges_[e].second) - 1;
    triplets.emplace_back(j, j, weights[e]);
    if (i < 0) continue;
    triplets.emplace_back(i, i, weights[e]);
    // The factorisation reads the lower triangle.
    triplets.emplace_back(j, i, -weights[e]);
  }
  Eigen::SparseMatrix<double> laplacian(size, size);
  laplacian.setFromTriplets(triplets.begin(), triplets.end());
  if (!is_analyzed_) {
    factorization_.analyzePattern(laplacian);
    is_analyzed_ = true;
  }
  factorization_.factorize(laplacian);
  if (factorization_.info() != Eigen::Success) return false;
  const Eigen::VectorXd pivots = factorization_.vectorD();
  if (!(pivots.minCoeff() > 1e-14 * pivots.maxCoeff())) return false;
  *solution = factorization_.solve(right_side);
  return solution->allFinite();
}

}  // namespace adasfm
