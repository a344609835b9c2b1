// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/edge_lengths.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "global/odometry/length_propagation.h"

namespace adasfm {
namespace {

// Edges that share at least this many keypoints come first; without metres,
// images that these edges do not reach start a part with a unit of its own.
constexpr int kNumSharedReliable = 20;
// Matches used per edge, those with the largest parallax. Bounds the time and
// the memory of an edge.
constexpr int kMaxNumMatches = 150;
// A pair without a baseline sees the scene that others see when it shares this
// many points of known depth with them; fewer agree by chance.
constexpr int kMinNumKnownDepths = 12;
// Passes over all edges after the first.
constexpr int kNumSweeps = 3;

// Seeds every part of the graph that shares too few points with the others, the
// edges with most matches first. The units of the parts are tied by the median
// depth of the scene, which is assumed to be the same everywhere.
void SeedParts(const ViewGraph& graph, LengthPropagation* propagation) {
  std::vector<int> order(graph.edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [propagation](int a, int b) {
    return propagation->NumMatches(a) > propagation->NumMatches(b);
  });
  for (const int e : order) {
    if (propagation->NumMatches(e) < kNumSharedReliable) break;
    if (propagation->TouchesKnown(e)) continue;
    propagation->Seed(e);
    propagation->Spread(kNumSharedReliable);
  }
}

}  // namespace

EdgeLengths EstimateEdgeLengths(
    int num_threads, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences, const EdgeLengths& start) {
  LengthPropagation propagation(kMaxNumMatches, num_threads, graph,
                                correspondences);
  EdgeLengths result;
  const size_t num_edges = graph.edges.size();
  for (size_t e = 0; e < num_edges; ++e) {
    const auto it = known_lengths_m.find(graph.edges[e].Pair());
    if (it == known_lengths_m.end() || !(it->second > 0.0)) continue;
    constexpr double kPriorLogSigma = 0.02;
    propagation.Fix(e, std::log(it->second), kPriorLogSigma);
    result.metric = true;
  }
  if (start.metric == result.metric) {
    for (size_t e = 0; e < start.lengths.size() && e < num_edges; ++e) {
      if (start.lengths[e].has_value()) propagation.Start(e, *start.lengths[e]);
    }
  }
  propagation.Spread(kNumSharedReliable);
  if (result.metric) propagation.Spread(LengthPropagation::kMinNumShared);
  std::vector<bool> is_by_depth(num_edges, false);
  for (size_t e = 0; result.metric && e < num_edges; ++e) {
    is_by_depth[e] = !propagation.IsKnown(e) || (e < start.lengths.size() &&
                                                 start.lengths[e].has_value() &&
                                                 start.lengths[e]->is_by_depth);
  }
  SeedParts(graph, &propagation);
  propagation.Spread(LengthPropagation::kMinNumShared);
  for (int i = 0; i < kNumSweeps; ++i) propagation.Sweep();
  result.lengths.resize(num_edges);
  for (size_t e = 0; e < num_edges; ++e) {
    if (!propagation.IsKnown(e)) continue;
    result.lengths[e] = propagation.Get(e);
    result.lengths[e]->is_by_depth = is_by_depth[e];
  }
  result.is_at_known_depth.resize(num_edges);
  for (size_t e = 0; e < num_edges; ++e) {
    result.is_at_known_depth[e] =
        graph.edges[e].IsAtOnePlace() &&
        propagation.NumKnownDepths(e, correspondences) >= kMinNumKnownDepths;
  }
  return result;
}

}  // namespace adasfm
