// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/factor_size.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

namespace adasfm {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

Matrix BuildPattern(const std::vector<std::vector<int>>& neighbors) {
  const int size = static_cast<int>(neighbors.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int node = 0; node < size; ++node) {
    entries.emplace_back(node, node, 1.0);
    for (const int neighbor : neighbors[node]) {
      entries.emplace_back(node, neighbor, 1.0);
      entries.emplace_back(neighbor, node, 1.0);
    }
  }
  Matrix pattern(size, size);
  pattern.setFromTriplets(entries.begin(), entries.end());
  return pattern;
}

}  // namespace

size_t CountFactorBlocks(const std::vector<std::vector<int>>& neighbors) {
  const Matrix pattern = BuildPattern(neighbors);
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> node_of_rank;
  Eigen::AMDOrdering<int>()(pattern, node_of_rank);
  const auto& nodes = node_of_rank.indices();
  std::vector<int> rank_of(nodes.size());
  for (int rank = 0; rank < nodes.size(); ++rank) rank_of[nodes[rank]] = rank;
  constexpr int kNone = -1;
  std::vector<int> parent(nodes.size(), kNone);
  std::vector<int> reached_by(nodes.size(), kNone);
  size_t num_blocks = 0;
  for (int rank = 0; rank < nodes.size(); ++rank) {
    reached_by[rank] = rank;
    for (Matrix::InnerIterator entry(pattern, nodes[rank]); entry; ++entry) {
      // Each step up the tree is a block of this row.
      for (int i = rank_of[entry.row()]; i < rank && reached_by[i] != rank;
           i = parent[i]) {
        if (parent[i] == kNone) parent[i] = rank;
        reached_by[i] = rank;
        ++num_blocks;
      }
    }
  }
  return num_blocks;
}

}  // namespace adasfm
