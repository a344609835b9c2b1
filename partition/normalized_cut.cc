// SPDX-License-Identifier: BSD-3-Clause
#include "partition/normalized_cut.h"

#include <metis.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "core/option_checker.h"

namespace adasfm {
namespace {

using Part = std::set<image_t>;

// METIS's result depends on the order in which it visits nodes.
constexpr int kMetisSeed = 1;

// The graph of one component in METIS's compressed rows.
struct MetisGraph {
  std::vector<idx_t> row_starts = {0};
  std::vector<idx_t> columns;
  std::vector<idx_t> weights;
};

MetisGraph BuildMetisGraph(const ImageAdjacency& adjacency,
                           const std::vector<image_t>& component) {
  std::map<image_t, idx_t> index_of_image;
  for (size_t i = 0; i < component.size(); ++i) {
    index_of_image[component[i]] = static_cast<idx_t>(i);
  }
  MetisGraph graph;
  for (const image_t image_id : component) {
    // METIS's result depends on the order within a row; the order by id is
    // unique.
    std::map<idx_t, idx_t> row;
    for (const auto& [neighbor, weight] : adjacency.at(image_id)) {
      // METIS sums weights in integers of 32 bits.
      row[index_of_image.at(neighbor)] =
          static_cast<idx_t>(std::clamp(std::round(weight), 1.0, 1e5));
    }
    for (const auto& [column, weight] : row) {
      graph.columns.push_back(column);
      graph.weights.push_back(weight);
    }
    graph.row_starts.push_back(static_cast<idx_t>(graph.columns.size()));
  }
  return graph;
}

std::vector<Part> CutWithMetis(const ImageAdjacency& adjacency,
                               const std::vector<image_t>& component,
                               int num_parts) {
  MetisGraph graph = BuildMetisGraph(adjacency, component);
  idx_t num_nodes = static_cast<idx_t>(component.size());
  idx_t num_constraints = 1;
  idx_t metis_num_parts = num_parts;
  idx_t cut = 0;
  idx_t metis_options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(metis_options);
  metis_options[METIS_OPTION_SEED] = kMetisSeed;
  metis_options[METIS_OPTION_CONTIG] = 1;
  std::vector<idx_t> part_of_node(component.size(), 0);
  if (METIS_PartGraphKway(&num_nodes, &num_constraints, graph.row_starts.data(),
                          graph.columns.data(), nullptr, nullptr,
                          graph.weights.data(), &metis_num_parts, nullptr,
                          nullptr, metis_options, &cut,
                          part_of_node.data()) != METIS_OK) {
    throw std::runtime_error("METIS could not cut the view graph");
  }
  std::vector<Part> parts(num_parts);
  for (size_t i = 0; i < component.size(); ++i) {
    parts[part_of_node[i]].insert(component[i]);
  }
  return parts;
}

// The part, other than `own`, with the strongest connection to the images; -1
// for none.
int FindStrongestNeighborPart(const ImageAdjacency& adjacency,
                              const std::vector<Part>& parts,
                              const std::vector<image_t>& images, int own) {
  std::map<image_t, int> part_of_image;
  for (size_t k = 0; k < parts.size(); ++k) {
    for (const image_t image_id : parts[k]) part_of_image[image_id] = k;
  }
  std::vector<double> strengths(parts.size(), 0.0);
  for (const image_t image_id : images) {
    for (const auto& [neighbor, weight] : adjacency.at(image_id)) {
      const int k = part_of_image.at(neighbor);
      if (k != own) strengths[k] += weight;
    }
  }
  const auto strongest = std::max_element(strengths.begin(), strengths.end());
  return *strongest > 0.0 ? static_cast<int>(strongest - strengths.begin())
                          : -1;
}

// One repair: removes an empty part, or moves the smallest piece of a
// disconnected or too small part to the part with the strongest connection to
// the piece. False when there was nothing to repair.
bool RepairOnePart(const ImageAdjacency& adjacency, size_t min_size,
                   std::vector<Part>* parts) {
  for (size_t k = 0; k < parts->size(); ++k) {
    const auto pieces = FindConnectedComponents(adjacency, (*parts)[k]);
    if (pieces.empty()) {
      parts->erase(parts->begin() + k);
      return true;
    }
    const bool too_small = (*parts)[k].size() < min_size;
    if (pieces.size() == 1 && !too_small) continue;
    const auto& piece = pieces.back();
    const int target = FindStrongestNeighborPart(adjacency, *parts, piece, k);
    if (target < 0) continue;
    for (const image_t image_id : piece) (*parts)[k].erase(image_id);
    (*parts)[target].insert(piece.begin(), piece.end());
    return true;
  }
  return false;
}

int MaxSize(const std::vector<Part>& parts) {
  size_t size = 0;
  for (const Part& part : parts) size = std::max(size, part.size());
  return static_cast<int>(size);
}

std::vector<Part> CutComponent(const NormalizedCutOptions& options,
                               const ImageAdjacency& adjacency,
                               const std::vector<image_t>& component) {
  std::vector<Part> best = {Part(component.begin(), component.end())};
  const int min_num_parts =
      (static_cast<int>(component.size()) - 1) / options.max_part_size + 1;
  // METIS balances up to a tolerance, and repairs change sizes: a few more
  // parts bring the largest part below the bound.
  const int max_num_parts = min_num_parts + 3 + min_num_parts / 2;
  for (int num_parts = min_num_parts;
       num_parts <= max_num_parts && MaxSize(best) > options.max_part_size;
       ++num_parts) {
    std::vector<Part> parts = CutWithMetis(adjacency, component, num_parts);
    while (RepairOnePart(adjacency, options.min_part_size, &parts)) {
    }
    if (MaxSize(parts) < MaxSize(best)) best = std::move(parts);
  }
  return best;
}

}  // namespace

bool NormalizedCutOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmPartition", error)
      .AtLeast(1, "min_part_size", min_part_size)
      .Require(max_part_size >= 2 * min_part_size, "max_part_size",
               max_part_size,
               "must be at least twice AdaSfmPartition.min_part_size")
      .AllHold();
}

std::vector<std::vector<image_t>> ComputeNormalizedCut(
    const NormalizedCutOptions& options, const ImageGraph& graph) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  const ImageAdjacency adjacency = BuildAdjacency(graph);
  const auto components = FindConnectedComponents(adjacency, graph.images);
  std::vector<std::vector<image_t>> parts;
  for (const std::vector<image_t>& component : components) {
    const int size = static_cast<int>(component.size());
    if (!parts.empty() && size < options.min_part_size) continue;
    for (const Part& part : CutComponent(options, adjacency, component)) {
      parts.emplace_back(part.begin(), part.end());
    }
  }
  std::sort(parts.begin(), parts.end());
  return parts;
}

}  // namespace adasfm
