// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/join_cells.h"

#include <tuple>

namespace adasfm {
namespace {

struct Candidate {
  JoinCell::Crossing crossing;
  bool has_motion = false;
  Rigid3d j_from_i;
};

Candidate MakeCandidate(const ViewGraph& graph, const DriveParts& parts,
                        const std::vector<std::optional<EdgeLength>>& lengths,
                        size_t e) {
  const ViewGraphEdge& edge = graph.edges[e];
  Candidate candidate;
  candidate.crossing = {static_cast<int>(e), graph.IndexOf(edge.image_id1),
                        graph.IndexOf(edge.image_id2)};
  candidate.j_from_i = edge.cam2_from_cam1;
  candidate.has_motion = edge.has_rotation && edge.has_translation &&
                         e < lengths.size() && lengths[e].has_value() &&
                         parts.frame_of[candidate.crossing.i] >= 0 &&
                         parts.frame_of[candidate.crossing.j] >= 0;
  if (candidate.has_motion) {
    candidate.j_from_i.translation =
        lengths[e]->length * edge.cam2_from_cam1.translation.normalized();
  }
  if (parts.part_of[candidate.crossing.i] >
      parts.part_of[candidate.crossing.j]) {
    std::swap(candidate.crossing.i, candidate.crossing.j);
    candidate.j_from_i = candidate.j_from_i.Inverse();
  }
  return candidate;
}

void AddCandidate(const ViewGraph& graph, const Candidate& candidate,
                  JoinCell* cell) {
  const int num_inliers = graph.edges[candidate.crossing.edge].num_inliers;
  const bool is_best =
      cell->crossings.empty() ||
      std::make_tuple(candidate.has_motion, num_inliers) >
          std::make_tuple(cell->has_motion,
                          graph.edges[cell->best.edge].num_inliers);
  cell->crossings.push_back(candidate.crossing);
  if (!is_best) return;
  cell->best = candidate.crossing;
  cell->has_motion = candidate.has_motion;
  cell->j_from_i = candidate.j_from_i;
}

}  // namespace

JoinCells CollectJoinCells(
    const ViewGraph& graph, const DriveParts& parts,
    const std::vector<std::optional<EdgeLength>>& lengths, int cell_size) {
  using Cells = std::map<std::pair<int64_t, int64_t>, JoinCell>;
  std::map<std::pair<int, int>, Cells> cells;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    if (!graph.edges[e].IsKept()) continue;
    const Candidate candidate = MakeCandidate(graph, parts, lengths, e);
    const auto& [edge, i, j] = candidate.crossing;
    if (parts.part_of[i] == parts.part_of[j]) continue;
    AddCandidate(
        graph, candidate,
        &cells[{parts.part_of[i], parts.part_of[j]}]
              [{parts.rank_of[i] / cell_size, parts.rank_of[j] / cell_size}]);
  }
  JoinCells by_parts;
  for (const auto& [pair, list] : cells) {
    for (const auto& [ends, cell] : list) by_parts[pair].push_back(cell);
  }
  return by_parts;
}

}  // namespace adasfm
