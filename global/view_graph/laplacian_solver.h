// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <utility>
#include <vector>

namespace adasfm {

// min over x of sum_e w_e |x_j - x_i - b_e|^2 for vectors x of three, x_0 = 0:
// one scalar graph Laplacian with three right-hand sides. The elimination order
// is found once for a graph.
class LaplacianSolver {
 public:
  using Vectors = Eigen::Matrix<double, Eigen::Dynamic, 3>;

  // Edges (i, j) of nodes 0 ... num_nodes - 1.
  LaplacianSolver(int num_nodes, std::vector<std::pair<int, int>> edges);

  // Weights >= 0. False when the system is singular even with a small ridge
  // (the edges of positive weight do not connect the nodes); *nodes is then
  // unchanged.
  bool Solve(const std::vector<double>& weights, const Vectors& differences,
             Vectors* nodes);

 private:
  bool SolveWithRidge(const std::vector<double>& weights,
                      const Vectors& right_side, double ridge,
                      Vectors* solution);

  int num_nodes_;
  std::vector<std::pair<int, int>> edges_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factorization_;
  bool is_analyzed_ = false;
};

}  // namespace adasfm
