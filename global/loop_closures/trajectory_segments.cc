// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/trajectory_segments.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/disjoint_sets.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Two closures between segments confirm each other only if the heading changes
// by this much between them: a long straight street can look alike all along.
constexpr double kMinTurnDeg = 30.0;

bool IsVisual(const ViewGraphEdge& edge) {
  return edge.IsKept() && edge.source != EdgeSource::kSensor;
}

void JoinSmallSegments(const ViewGraph& graph, DisjointSets* sets) {
  std::vector<int> num_images(graph.images.size(), 0);
  for (size_t i = 0; i < graph.images.size(); ++i) ++num_images[sets->Find(i)];
  // Number of pairs, by small and other segment.
  std::map<int, std::map<int, int>> num_shared;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!IsVisual(edge)) continue;
    const int a = sets->Find(graph.IndexOf(edge.image_id1));
    const int b = sets->Find(graph.IndexOf(edge.image_id2));
    if (a == b) continue;
    if (num_images[a] < kMinNumSegmentImages) ++num_shared[a][b];
    if (num_images[b] < kMinNumSegmentImages) ++num_shared[b][a];
  }
  for (const auto& [segment, others] : num_shared) {
    const auto host = std::max_element(
        others.begin(), others.end(),
        [](const auto& a, const auto& b) { return a.second < b.second; });
    sets->Join(segment, host->first);
  }
}

std::vector<int> CountHeadings(const OdometryChain& chain,
                               const ViewGraph& graph) {
  std::vector<int> heading_of(graph.images.size(), 0);
  std::vector<std::pair<int, int>> order;  // index in the chain, image
  for (size_t i = 0; i < graph.images.size(); ++i) {
    const int index = chain.Index(graph.images[i]);
    if (index >= 0) order.emplace_back(index, i);
  }
  std::sort(order.begin(), order.end());
  int heading = 0;
  int piece = -1;
  Eigen::Quaterniond begin = Eigen::Quaterniond::Identity();
  for (const auto& [index, i] : order) {
    const Eigen::Quaterniond rotation =
        chain.CamFromStart(graph.images[i]).rotation;
    if (chain.Piece(graph.images[i]) != piece ||
        rotation.angularDistance(begin) > DegToRad(kMinTurnDeg)) {
      ++heading;
      begin = rotation;
      piece = chain.Piece(graph.images[i]);
    }
    heading_of[i] = heading;
  }
  return heading_of;
}

}  // namespace

TrajectorySegments FindTrajectorySegments(
    const LoopClosureOptions& options,
    const std::vector<RelativePosePrior>& priors, const OdometryChain& chain,
    const ViewGraph& graph) {
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
  JoinSmallSegments(graph, &sets);
  TrajectorySegments segments;
  segments.num_images.assign(size, 0);
  segments.is_metric.assign(size, false);
  for (int i = 0; i < size; ++i) {
    segments.segment_of.push_back(sets.Find(i));
    segments.rank_of.push_back(graph.CaptureRank(i));
    ++segments.num_images[segments.segment_of[i]];
  }
  for (const int i : metric_images) {
    segments.is_metric[segments.segment_of[i]] = true;
  }
  segments.heading_of = CountHeadings(chain, graph);
  return segments;
}

}  // namespace adasfm
