// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/filter_unverified_joins.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

#include "global/loop_closures/confirm_join.h"
#include "global/loop_closures/drive_parts.h"
#include "global/loop_closures/join_cells.h"

namespace adasfm {
namespace {

int CountPairs(const std::vector<JoinCell>& cells) {
  int num_pairs = 0;
  for (const JoinCell& cell : cells) num_pairs += cell.crossings.size();
  return num_pairs;
}

// The part to which each one that is too small to judge belongs: it shares most
// pairs with that.
std::map<int, int> FindHosts(const JoinFilterOptions& options,
                             const DriveParts& parts, const JoinCells& cells) {
  std::map<int, std::pair<int, int>> best;  // number of pairs, host
  const auto offer = [&](int part, int host, int num_pairs) {
    if (parts.num_images[part] >= options.min_num_images) return;
    auto& entry = best.try_emplace(part, 0, -1).first->second;
    if (num_pairs > entry.first) entry = {num_pairs, host};
  };
  for (const auto& [pair, list] : cells) {
    offer(pair.first, pair.second, CountPairs(list));
    offer(pair.second, pair.first, CountPairs(list));
  }
  std::map<int, int> hosts;
  for (const auto& [part, entry] : best) hosts[part] = entry.second;
  return hosts;
}

// Those that stay.
std::vector<bool> SelectCells(const JoinFilterOptions& options,
                              const DriveParts& parts,
                              const std::map<int, int>& hosts,
                              const std::pair<int, int>& pair,
                              const std::vector<JoinCell>& cells) {
  const auto is_host = [&hosts](int part, int host) {
    const auto it = hosts.find(part);
    return it != hosts.end() && it->second == host;
  };
  const auto [first, second] = pair;
  if (hosts.count(first) == 0 && hosts.count(second) == 0) {
    return ConfirmJoin(options, parts, cells);
  }
  return std::vector<bool>(cells.size(),
                           is_host(first, second) || is_host(second, first));
}

void RemoveCell(const JoinCell& cell, ViewGraph* graph, SplitJoin* split) {
  for (const JoinCell::Crossing& crossing : cell.crossings) {
    ViewGraphEdge& edge = graph->edges[crossing.edge];
    edge.removal = EdgeRemoval::kUnverifiedJoin;
    if (split->num_pairs++ == 0 ||
        edge.num_inliers >
            graph
                ->edges[FindEdge(*graph,
                                 ImagePair(split->image_id1, split->image_id2))]
                .num_inliers) {
      split->image_id1 = edge.image_id1;
      split->image_id2 = edge.image_id2;
    }
  }
}

}  // namespace

bool JoinFilterOptions::IsValid(std::string* error) const {
  if (max_sequence_gap < 1 || min_num_images < 1 || min_num_pairs < 1 ||
      max_place_images < 1) {
    *error = "max_sequence_gap = " + std::to_string(max_sequence_gap) +
             ", min_num_images = " + std::to_string(min_num_images) +
             ", min_num_pairs = " + std::to_string(min_num_pairs) +
             " and max_place_images = " + std::to_string(max_place_images) +
             " must be >= 1";
    return false;
  }
  if (!(min_turn_deg > 0.0) || !(max_rotation_error_deg > 0.0) ||
      !(max_position_error_ratio > 0.0)) {
    *error =
        "min_turn_deg = " + std::to_string(min_turn_deg) +
        ", max_rotation_error_deg = " + std::to_string(max_rotation_error_deg) +
        " and max_position_error_ratio = " +
        std::to_string(max_position_error_ratio) + " must be > 0";
    return false;
  }
  return true;
}

JoinFilterReport FilterUnverifiedJoins(
    const JoinFilterOptions& options,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<std::optional<EdgeLength>>& lengths, ViewGraph* graph) {
  std::string error;
  if (!options.IsValid(&error)) {
    throw std::invalid_argument("FilterUnverifiedJoins: " + error);
  }
  JoinFilterReport report;
  const DriveParts parts = FindDriveParts(
      *graph, priors, lengths, options.max_sequence_gap, options.min_turn_deg);
  for (const int num_images : parts.num_images) {
    report.num_parts += num_images >= options.min_num_images;
  }
  const JoinCells cells = CollectJoinCells(*graph, parts, lengths,
                                           options.max_sequence_gap / 2 + 1);
  const std::map<int, int> hosts = FindHosts(options, parts, cells);
  for (const auto& [pair, list] : cells) {
    const std::vector<bool> is_kept =
        SelectCells(options, parts, hosts, pair, list);
    SplitJoin split;
    split.num_images =
        std::min(parts.num_images[pair.first], parts.num_images[pair.second]);
    for (size_t c = 0; c < list.size(); ++c) {
      if (!is_kept[c]) RemoveCell(list[c], graph, &split);
    }
    report.num_removed_pairs += split.num_pairs;
    if (std::count(is_kept.begin(), is_kept.end(), true) > 0) {
      ++report.num_confirmed;
    } else {
      report.split.push_back(split);
    }
  }
  return report;
}

}  // namespace adasfm
