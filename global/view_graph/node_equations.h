// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/sparse/block_matrix.h"
#include "core/sparse/ordered_cholesky.h"

namespace adasfm {

// Normal equations of vectors of three at the nodes of a graph, x_0 = 0:
// min sum over edges (i, j) of (x_j - x_i - b)^T W (x_j - x_i - b). kSize: 3,
// or 1 where each W is a multiple of the unit matrix and the axes have the same
// equations. The elimination order is found once for a graph.
template <int kSize>
class NodeEquations {
 public:
  using Vectors = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  using Weight = Eigen::Matrix<double, kSize, kSize>;

  // Edges (i, j) of nodes 0 ... num_nodes - 1; throws where one is not.
  NodeEquations(int num_nodes, const std::vector<std::pair<int, int>>& edges) {
    for (int node = 1; node < num_nodes; ++node) matrix_.AddBlock(kSize);
    for (const auto& [i, j] : edges) {
      if (i < 0 || j < 0 || i >= num_nodes || j >= num_nodes || i == j) {
        throw std::invalid_argument("NodeEquations: edge out of range");
      }
      if (i > 0 && j > 0) matrix_.AddPair(i - 1, j - 1);
    }
    if (num_nodes < 2) return;
    block_of_ = matrix_.Reorder();
    matrix_.Allocate();
    factorization_.analyzePattern(matrix_.Matrix());
  }

  // Forgets all edges; the diagonal begins with `ridge`.
  void Clear(double ridge = 0.0) {
    matrix_.Matrix().coeffs().setZero();
    right_side_.setZero(matrix_.NumColumns(), kNumSides);
    for (int block = 0; block < matrix_.NumBlocks(); ++block) {
      matrix_.Add(block, block, Weight(ridge * Weight::Identity()));
    }
  }

  // Adds the term of edge (i, j), one of the constructor's: b is `target`.
  void Add(int i, int j, const Weight& weight, const Eigen::Vector3d& target) {
    const Side flow = weight * Eigen::Map<const Side>(target.data());
    if (i > 0) AddNode(i, weight, -flow);
    if (j > 0) AddNode(j, weight, flow);
    if (i == 0 || j == 0) return;
    const auto [col, row] = std::minmax(block_of_[i - 1], block_of_[j - 1]);
    matrix_.Add(row, col, Weight(-weight));
  }

  // Sets the nodes to the minimum. False where the equations are singular or
  // their reciprocal condition is not above the least; *nodes then stays.
  bool Solve(double min_reciprocal_condition, Vectors* nodes) {
    Eigen::Matrix<double, Eigen::Dynamic, kNumSides> solution;
    if (!block_of_.empty()) {
      factorization_.factorize(matrix_.Matrix());
      if (factorization_.info() != Eigen::Success ||
          !(factorization_.ReciprocalCondition() > min_reciprocal_condition)) {
        return false;
      }
      solution = factorization_.solve(right_side_);
      if (!solution.allFinite()) return false;
    }
    nodes->setZero(block_of_.size() + 1, 3);
    for (size_t k = 0; k < block_of_.size(); ++k) {
      const Side node =
          solution.template middleRows<kSize>(kSize * block_of_[k]);
      nodes->row(k + 1) = Eigen::Map<const Eigen::RowVector3d>(node.data());
    }
    return true;
  }

 private:
  static constexpr int kNumSides = 3 / kSize;
  // A node's share of the right sides; as numbers in memory, a vector of three.
  using Side = Eigen::Matrix<double, kSize, kNumSides>;

  void AddNode(int node, const Weight& weight, const Side& flow) {
    const int block = block_of_[node - 1];
    matrix_.Add(block, block, weight);
    right_side_.template middleRows<kSize>(kSize * block) += flow;
  }

  BlockMatrix matrix_;
  std::vector<int> block_of_;  // Of node k + 1.
  Eigen::Matrix<double, Eigen::Dynamic, kNumSides> right_side_;
  OrderedCholesky factorization_;
};

}  // namespace adasfm
