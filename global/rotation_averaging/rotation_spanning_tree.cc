// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/rotation_spanning_tree.h"

#include <algorithm>
#include <numeric>

#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// By node, the edges of the tree that end there (Kruskal; ties in order of the
// edges).
std::vector<std::vector<int>> BuildTree(const std::vector<RotationEdge>& edges,
                                        size_t num_nodes) {
  std::vector<int> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&edges](int a, int b) {
    return edges[a].sigma_rad < edges[b].sigma_rad;
  });
  DisjointSets sets(num_nodes);
  std::vector<std::vector<int>> tree(num_nodes);
  for (const int e : order) {
    if (sets.Find(edges[e].i) == sets.Find(edges[e].j)) continue;
    sets.Join(edges[e].i, edges[e].j);
    tree[edges[e].i].push_back(e);
    tree[edges[e].j].push_back(e);
  }
  return tree;
}

}  // namespace

bool PropagateRotationsOverTree(const std::vector<RotationEdge>& edges,
                                size_t num_nodes,
                                std::vector<Eigen::Matrix3d>* rotations) {
  const std::vector<std::vector<int>> tree = BuildTree(edges, num_nodes);
  rotations->assign(num_nodes, Eigen::Matrix3d::Identity());
  std::vector<bool> is_visited(num_nodes, false);
  std::vector<int> queue = {0};
  is_visited[0] = true;
  for (size_t head = 0; head < queue.size(); ++head) {
    for (const int e : tree[queue[head]]) {
      const RotationEdge& edge = edges[e];
      const bool is_forward = edge.i == queue[head];
      const int other = is_forward ? edge.j : edge.i;
      if (is_visited[other]) continue;
      is_visited[other] = true;
      if (is_forward) {
        (*rotations)[other] = edge.rotation * (*rotations)[edge.i];
      } else {
        (*rotations)[other] = edge.rotation.transpose() * (*rotations)[edge.j];
      }
      queue.push_back(other);
    }
  }
  return queue.size() == num_nodes;
}

}  // namespace adasfm
