// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/drive_parts.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <utility>

#include "core/disjoint_sets.h"
#include "core/so3.h"

namespace adasfm {
namespace {

bool IsVisual(const ViewGraphEdge& edge) {
  return edge.IsKept() && edge.source != EdgeSource::kSensor;
}

void JoinSmallParts(const ViewGraph& graph, DisjointSets* sets) {
  std::vector<int> num_images(graph.images.size(), 0);
  for (size_t i = 0; i < graph.images.size(); ++i) ++num_images[sets->Find(i)];
  std::map<int, std::map<int, int>> num_shared;  // pairs, by small part, other
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!IsVisual(edge)) continue;
    const int a = sets->Find(graph.IndexOf(edge.image_id1));
    const int b = sets->Find(graph.IndexOf(edge.image_id2));
    if (a == b) continue;
    if (num_images[a] < kMinNumPartImages) ++num_shared[a][b];
    if (num_images[b] < kMinNumPartImages) ++num_shared[b][a];
  }
  for (const auto& [part, others] : num_shared) {
    const auto host = std::max_element(
        others.begin(), others.end(),
        [](const auto& a, const auto& b) { return a.second < b.second; });
    sets->Join(part, host->first);
  }
}

std::vector<int> CountStreets(const LoopClosureOptions& options,
                              const OdometryChain& chain,
                              const ViewGraph& graph) {
  std::vector<int> street_of(graph.images.size(), 0);
  std::vector<std::pair<int, int>> order;  // in the chain, image
  for (size_t i = 0; i < graph.images.size(); ++i) {
    const int index = chain.Index(graph.images[i]);
    if (index >= 0) order.emplace_back(index, i);
  }
  std::sort(order.begin(), order.end());
  int street = 0;
  int piece = -1;
  Eigen::Quaterniond begin = Eigen::Quaterniond::Identity();
  for (const auto& [index, i] : order) {
    const Eigen::Quaterniond rotation =
        chain.CamFromStart(graph.images[i]).rotation;
    const bool is_new_piece = chain.Piece(graph.images[i]) != piece;
    if (is_new_piece ||
        rotation.angularDistance(begin) > DegToRad(options.min_turn_deg)) {
      ++street;
      begin = rotation;
      piece = chain.Piece(graph.images[i]);
    }
    street_of[i] = street;
  }
  return street_of;
}

}  // namespace

bool DriveParts::AreApart(const LoopClosureOptions& options, int i,
                          int j) const {
  return std::abs(rank_of[i] - rank_of[j]) > options.max_sequence_gap &&
         street_of[i] != street_of[j];
}

DriveParts FindDriveParts(const LoopClosureOptions& options,
                          const std::vector<RelativePosePrior>& priors,
                          const OdometryChain& chain, const ViewGraph& graph) {
  const int size = graph.images.size();
  DisjointSets sets(size);
  std::vector<int> metric_images;
  for (const RelativePosePrior& prior : priors) {
    const int i = graph.IndexOf(prior.image_id1);
    const int j = graph.IndexOf(prior.image_id2);
    if (i < 0 || j < 0 || !prior.HasMotion()) continue;
    sets.Join(i, j);
    metric_images.push_back(i);
  }
  for (const ViewGraphEdge& edge : graph.edges) {
    if (IsVisual(edge) && graph.CaptureGap(edge) <= options.max_sequence_gap) {
      sets.Join(graph.IndexOf(edge.image_id1), graph.IndexOf(edge.image_id2));
    }
  }
  JoinSmallParts(graph, &sets);
  DriveParts parts;
  parts.num_images.assign(size, 0);
  parts.is_metric.assign(size, false);
  for (int i = 0; i < size; ++i) {
    parts.part_of.push_back(sets.Find(i));
    parts.rank_of.push_back(graph.CaptureRank(i));
    ++parts.num_images[parts.part_of[i]];
  }
  for (const int i : metric_images) parts.is_metric[parts.part_of[i]] = true;
  parts.street_of = CountStreets(options, chain, graph);
  return parts;
}

}  // namespace adasfm
