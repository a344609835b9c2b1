// SPDX-License-Identifier: BSD-3-Clause
#include "partition/flood_fill.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace adasfm {
namespace {

using Part = std::set<image_t>;

struct WeightedEdge {
  ImagePair pair;
  double weight;
};

std::vector<WeightedEdge> SortEdges(const ImageGraph& graph) {
  std::vector<WeightedEdge> edges;
  for (const auto& [pair, weight] : graph.edges) {
    edges.push_back({pair, weight});
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const WeightedEdge& a, const WeightedEdge& b) {
                     return a.weight > b.weight;
                   });
  return edges;
}

std::vector<double> OverlapRatios(const std::vector<Part>& parts) {
  std::map<image_t, int> num_parts_of_image;
  for (const Part& part : parts) {
    for (const image_t image_id : part) ++num_parts_of_image[image_id];
  }
  std::vector<double> ratios;
  for (const Part& part : parts) {
    const auto num_shared = std::count_if(
        part.begin(), part.end(),
        [&](image_t image_id) { return num_parts_of_image.at(image_id) > 1; });
    ratios.push_back(part.empty() ? 0.0 : 1.0 * num_shared / part.size());
  }
  return ratios;
}

// One layer of the flood fill.
class Layer {
 public:
  Layer(const std::vector<WeightedEdge>& edges, double min_overlap_ratio,
        std::vector<Part>* parts)
      : parts_(*parts) {
    const std::vector<double> ratios = OverlapRatios(*parts);
    for (size_t k = 0; k < parts->size(); ++k) {
      wants_more_.push_back(ratios[k] < min_overlap_ratio);
      for (const image_t image_id : (*parts)[k]) {
        parts_of_image_[image_id].push_back(k);
      }
    }
    for (const WeightedEdge& edge : edges) GiveEdge(edge.pair);
  }

  // Whether any part took an image.
  bool Grew() const { return !served_separators_.empty(); }

 private:
  struct Offer {
    int part = -1;
    image_t separator = kInvalidImageId;
    image_t image = kInvalidImageId;
  };

  void GiveEdge(const ImagePair& pair) {
    Offer best;
    FindOffer(pair.image_id1, pair.image_id2, &best);
    FindOffer(pair.image_id2, pair.image_id1, &best);
    if (best.part < 0) return;
    served_separators_.emplace(best.part, best.separator);
    parts_[best.part].insert(best.image);
  }

  void FindOffer(image_t separator, image_t image, Offer* best) const {
    const auto parts = parts_of_image_.find(separator);
    if (parts == parts_of_image_.end()) return;
    for (const int k : parts->second) {
      if (!wants_more_[k] || parts_[k].count(image) ||
          served_separators_.count({k, separator})) {
        continue;
      }
      const auto key = std::make_pair(parts_[k].size(), k);
      if (best->part < 0 ||
          key < std::make_pair(parts_[best->part].size(), best->part)) {
        *best = {k, separator, image};
      }
    }
  }

  std::vector<Part>& parts_;
  std::vector<bool> wants_more_;
  // State at the beginning of the layer: images taken in a layer become
  // separators in the next one.
  std::map<image_t, std::vector<int>> parts_of_image_;
  std::set<std::pair<int, image_t>> served_separators_;
};

std::vector<std::vector<image_t>> AsVectors(const std::vector<Part>& parts) {
  std::vector<std::vector<image_t>> vectors;
  for (const Part& part : parts) vectors.emplace_back(part.begin(), part.end());
  return vectors;
}

std::vector<Part> AsSets(const std::vector<std::vector<image_t>>& parts) {
  std::vector<Part> sets;
  for (const auto& part : parts) sets.emplace_back(part.begin(), part.end());
  return sets;
}

}  // namespace

std::vector<std::vector<image_t>> ExpandByFloodFill(
    double min_overlap_ratio, const ImageGraph& graph,
    const std::vector<std::vector<image_t>>& parts) {
  const std::vector<WeightedEdge> edges = SortEdges(graph);
  std::vector<Part> expanded = AsSets(parts);
  while (Layer(edges, min_overlap_ratio, &expanded).Grew()) {
  }
  return AsVectors(expanded);
}

std::vector<double> ComputeOverlapRatios(
    const std::vector<std::vector<image_t>>& parts) {
  return OverlapRatios(AsSets(parts));
}

}  // namespace adasfm
