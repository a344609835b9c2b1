// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/view_graph.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/disjoint_sets.h"

namespace adasfm {

const char* EdgeRemovalName(EdgeRemoval removal) {
  switch (removal) {
    case EdgeRemoval::kKept:
      return "kept";
    case EdgeRemoval::kFewInliers:
      return "few inliers";
    case EdgeRemoval::kOdometryPose:
      return "pose contradicts odometry";
    case EdgeRemoval::kOdometry:
      return "contradicts odometry";
    case EdgeRemoval::kFalseLoop:
      return "inconsistent with other loops";
    case EdgeRemoval::kUnconfirmedClosure:
      return "alone joins two parts";
    case EdgeRemoval::kUnknownSize:
      return "joins parts of unknown relative size";
    case EdgeRemoval::kRotation:
      return "off the global rotations";
    case EdgeRemoval::kTranslation:
      return "off the global positions";
    case EdgeRemoval::kDisconnected:
      return "disconnected";
  }
  return "unknown";
}

int ViewGraph::IndexOf(image_t image_id) const {
  const auto it = std::lower_bound(images.begin(), images.end(), image_id);
  if (it == images.end() || *it != image_id) return -1;
  return static_cast<int>(it - images.begin());
}

void ViewGraph::Check() const {
  for (const auto* values : {&capture_ranks, &capture_positions}) {
    if (!values->empty() && values->size() != images.size()) {
      throw std::invalid_argument("ViewGraph: not one capture rank per image");
    }
  }
  for (size_t i = 1; i < images.size(); ++i) {
    if (images[i - 1] >= images[i]) {
      throw std::invalid_argument("ViewGraph: images are not sorted");
    }
  }
  for (size_t e = 0; e < edges.size(); ++e) {
    const ViewGraphEdge& edge = edges[e];
    const std::string name = "ViewGraph: edge (" +
                             std::to_string(edge.image_id1) + ", " +
                             std::to_string(edge.image_id2) + ") ";
    if (edge.image_id1 >= edge.image_id2) {
      throw std::invalid_argument(name + "must have image_id1 < image_id2");
    }
    if (e > 0 && !(edges[e - 1].Pair() < edge.Pair())) {
      throw std::invalid_argument(name + "is out of order or twice there");
    }
    if (IndexOf(edge.image_id1) < 0 || IndexOf(edge.image_id2) < 0) {
      throw std::invalid_argument(name + "joins an image not in the graph");
    }
    if (edge.IsKept() &&
        !(edge.cam2_from_cam1.ToMatrix().allFinite() &&
          edge.rotation_sigma_rad > 0 && edge.direction_sigma_rad > 0)) {
      throw std::invalid_argument(name + "has values that are not finite");
    }
  }
}

std::vector<std::vector<image_t>> FindConnectedComponents(
    const ViewGraph& graph) {
  DisjointSets sets(graph.images.size());
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept()) continue;
    const int a = sets.Find(graph.IndexOf(edge.image_id1));
    const int b = sets.Find(graph.IndexOf(edge.image_id2));
    // The root is the smallest index, so roots are in order of the ids.
    sets.Join(std::max(a, b), std::min(a, b));
  }
  std::map<int, std::vector<image_t>> by_root;
  for (size_t i = 0; i < graph.images.size(); ++i) {
    by_root[sets.Find(i)].push_back(graph.images[i]);
  }
  std::vector<std::vector<image_t>> components;
  for (auto& [root, images] : by_root) components.push_back(std::move(images));
  std::stable_sort(
      components.begin(), components.end(),
      [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return components;
}

ViewGraph ExtractSubgraph(const ViewGraph& graph,
                          const std::vector<image_t>& images) {
  ViewGraph subgraph;
  subgraph.images = images;
  for (const image_t image_id : images) {
    const int i = graph.IndexOf(image_id);
    if (!graph.capture_ranks.empty()) {
      subgraph.capture_ranks.push_back(graph.capture_ranks[i]);
    }
    if (!graph.capture_positions.empty()) {
      subgraph.capture_positions.push_back(graph.capture_positions[i]);
    }
  }
  for (const ViewGraphEdge& edge : graph.edges) {
    if (subgraph.IndexOf(edge.image_id1) >= 0 &&
        subgraph.IndexOf(edge.image_id2) >= 0) {
      subgraph.edges.push_back(edge);
    }
  }
  return subgraph;
}

int FindEdge(const ViewGraph& graph, const ImagePair& pair) {
  const auto it =
      std::lower_bound(graph.edges.begin(), graph.edges.end(), pair,
                       [](const ViewGraphEdge& edge, const ImagePair& value) {
                         return edge.Pair() < value;
                       });
  if (it == graph.edges.end() || !(it->Pair() == pair)) return -1;
  return static_cast<int>(it - graph.edges.begin());
}

std::map<EdgeRemoval, int> CountRemovals(const ViewGraph& graph) {
  std::map<EdgeRemoval, int> counts;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept()) ++counts[edge.removal];
  }
  return counts;
}

}  // namespace adasfm
