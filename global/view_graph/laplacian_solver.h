// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <utility>
#include <vector>

#include "core/sparse/block_matrix.h"

namespace adasfm {

class OrderedCholesky;

// min over x of sum_e w_e |x_j - x_i - b_e|^2 for vectors x of three, x_0 = 0:
// one scalar graph Laplacian with three right-hand sides. The elimination order
// is found once for a graph.
class LaplacianSolver {
 public:
  using Vectors = Eigen::Matrix<double, Eigen::Dynamic, 3>;

  // Edges (i, j) of nodes 0 ... num_nodes - 1.
  LaplacianSolver(int num_nodes, std::vector<std::pair<int, int>> edges);
  ~LaplacianSolver();

  // Weights >= 0. False when the system is singular even with a small ridge
  // (the edges of positive weight do not connect the nodes); *nodes is then
  // unchanged.
  bool Solve(const std::vector<double>& weights, const Vectors& differences,
             Vectors* nodes);

 private:
  // The row of the equations of a node other than 0.
  int RowOf(int node) const { return row_of_[node - 1]; }
  void Add(int row, int col, double value);
  bool SolveWithRidge(const std::vector<double>& weights,
                      const Vectors& right_side, double ridge,
                      Vectors* solution);

  int num_nodes_;
  std::vector<std::pair<int, int>> edges_;
  std::vector<int> row_of_;
  BlockMatrix laplacian_;
  std::unique_ptr<OrderedCholesky> factorization_;
};

}  // namespace adasfm
