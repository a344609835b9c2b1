// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "global/view_graph/node_equations.h"

namespace adasfm {

// min over x of sum_e w_e |x_j - x_i - b_e|^2 for vectors x of three, x_0 = 0:
// one scalar graph Laplacian with three right-hand sides. The elimination order
// is found once for a graph.
class LaplacianSolver {
 public:
  using Vectors = NodeEquations<1>::Vectors;

  // Edges (i, j) of nodes 0 ... num_nodes - 1.
  LaplacianSolver(int num_nodes, std::vector<std::pair<int, int>> edges);

  // Weights >= 0. False when the system is singular even with a small ridge
  // (the edges of positive weight do not connect the nodes); *nodes is then
  // unchanged.
  bool Solve(const std::vector<double>& weights, const Vectors& differences,
             Vectors* nodes);

 private:
  std::vector<std::pair<int, int>> edges_;
  NodeEquations<1> equations_;
};

}  // namespace adasfm
