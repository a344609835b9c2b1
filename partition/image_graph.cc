// SPDX-License-Identifier: BSD-3-Clause
#include "partition/image_graph.h"

#include <algorithm>
#include <stdexcept>

namespace adasfm {

ImageAdjacency BuildAdjacency(const ImageGraph& graph) {
  ImageAdjacency adjacency;
  for (const image_t image_id : graph.images) adjacency[image_id];
  for (const auto& [pair, weight] : graph.edges) {
    if (!graph.images.count(pair.image_id1) ||
        !graph.images.count(pair.image_id2)) {
      throw std::invalid_argument("BuildAdjacency: edge to an unknown image");
    }
    adjacency[pair.image_id1].emplace_back(pair.image_id2, weight);
    adjacency[pair.image_id2].emplace_back(pair.image_id1, weight);
  }
  for (auto& [image_id, neighbors] : adjacency) {
    std::sort(neighbors.begin(), neighbors.end(),
              [](const auto& a, const auto& b) {
                if (a.second != b.second) return a.second > b.second;
                return a.first < b.first;
              });
  }
  return adjacency;
}

std::vector<std::vector<image_t>> FindConnectedComponents(
    const ImageAdjacency& adjacency, const std::set<image_t>& images) {
  std::vector<std::vector<image_t>> components;
  std::set<image_t> remaining = images;
  while (!remaining.empty()) {
    std::vector<image_t> component = {*remaining.begin()};
    remaining.erase(remaining.begin());
    for (size_t i = 0; i < component.size(); ++i) {
      for (const auto& [neighbor, weight] : adjacency.at(component[i])) {
        if (remaining.erase(neighbor)) component.push_back(neighbor);
      }
    }
    std::sort(component.begin(), component.end());
    components.push_back(std::move(component));
  }
  std::stable_sort(
      components.begin(), components.end(),
      [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return components;
}

}  // namespace adasfm
