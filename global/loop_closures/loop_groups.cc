// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/loop_groups.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <tuple>

namespace adasfm {
namespace {

// An edge from the image whose part has the smaller index, or that is earlier.
struct Crossing {
  int edge = 0;
  int i = 0;
  int j = 0;
  bool is_inverse = false;
};

Crossing MakeCrossing(const ViewGraph& graph, const DriveParts& parts, int e) {
  Crossing crossing{e, graph.IndexOf(graph.edges[e].image_id1),
                    graph.IndexOf(graph.edges[e].image_id2), false};
  const auto place = [&parts](int image) {
    return std::make_pair(parts.part_of[image], parts.rank_of[image]);
  };
  if (place(crossing.i) > place(crossing.j)) {
    std::swap(crossing.i, crossing.j);
    crossing.is_inverse = true;
  }
  return crossing;
}

// The groups so far, to find those that lie around a crossing.
class GroupGrid {
 public:
  GroupGrid(const DriveParts& parts, int max_gap)
      : parts_(parts), max_gap_(max_gap) {}

  // In the order of their indices.
  std::vector<int> FindNear(const std::vector<LoopGroup>& groups,
                            const Crossing& crossing) const {
    const auto [part1, part2, row, col] = Cell(crossing.i, crossing.j);
    std::vector<int> near;
    for (int64_t r = row - 1; r <= row + 1; ++r) {
      for (int64_t c = col - 1; c <= col + 1; ++c) {
        const auto it = cells_.find({part1, part2, r, c});
        if (it == cells_.end()) continue;
        for (const int g : it->second) {
          if (IsNear(groups[g].i, crossing.i) &&
              IsNear(groups[g].j, crossing.j)) {
            near.push_back(g);
          }
        }
      }
    }
    std::sort(near.begin(), near.end());
    return near;
  }
  void Add(int group, const Crossing& crossing) {
    cells_[Cell(crossing.i, crossing.j)].push_back(group);
  }

 private:
  using Key = std::tuple<int, int, int64_t, int64_t>;
  Key Cell(int i, int j) const {
    return {parts_.part_of[i], parts_.part_of[j],
            parts_.rank_of[i] / (max_gap_ + 1),
            parts_.rank_of[j] / (max_gap_ + 1)};
  }
  bool IsNear(int a, int b) const {
    return std::abs(parts_.rank_of[a] - parts_.rank_of[b]) <= max_gap_ &&
           parts_.street_of[a] == parts_.street_of[b];
  }

  const DriveParts& parts_;
  int max_gap_;
  std::map<Key, std::vector<int>> cells_;
};

}  // namespace

std::vector<LoopGroup> GroupLoops(
    const LoopClosureOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, const DriveParts& parts,
    const std::vector<PairMotion>& pairs, const std::vector<bool>& is_excluded,
    const std::vector<int>& edges, double unit_log_sigma) {
  std::vector<int> order = edges;
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    const auto quality = [&](int e) {
      return std::make_tuple(
          !is_excluded[e],
          pairs[e].translation == PairMotion::Translation::kFull,
          graph.edges[e].num_inliers);
    };
    return quality(a) > quality(b);
  });
  std::vector<LoopGroup> groups;
  GroupGrid grid(parts, options.max_sequence_gap);
  for (const int e : order) {
    const Crossing crossing = MakeCrossing(graph, parts, e);
    const LoopGroup alone{{e},
                          crossing.i,
                          crossing.j,
                          crossing.is_inverse ? pairs[e].Inverse() : pairs[e]};
    const std::vector<int> near = grid.FindNear(groups, crossing);
    const auto host = std::find_if(near.begin(), near.end(), [&](int g) {
      return is_excluded[e] || AreConsistent(options, chain, graph, groups[g],
                                             alone, unit_log_sigma)
                                   .value_or(true);
    });
    if (host != near.end()) {
      groups[*host].edges.push_back(e);
    } else {
      grid.Add(groups.size(), crossing);
      groups.push_back(alone);
    }
  }
  return groups;
}

std::optional<bool> AreConsistent(const LoopClosureOptions& options,
                                  const OdometryChain& chain,
                                  const ViewGraph& graph, const LoopGroup& a,
                                  const LoopGroup& b, double unit_log_sigma) {
  if (!chain.IsConnected(graph.images[a.i], graph.images[b.i]) ||
      !chain.IsConnected(graph.images[a.j], graph.images[b.j])) {
    return std::nullopt;
  }
  const ChainMotion first = chain.Motion(graph.images[b.i], graph.images[a.i]);
  const ChainMotion second = chain.Motion(graph.images[a.j], graph.images[b.j]);
  if (!first.has_rotation || !second.has_rotation) return std::nullopt;
  const bool has_position =
      first.has_position && second.has_position &&
      a.j_from_i.translation == PairMotion::Translation::kFull;
  UncertainMotion predicted =
      UncertainMotion{second.cam2_from_cam1, second.covariance} *
      a.j_from_i.motion *
      UncertainMotion{first.cam2_from_cam1, first.covariance};
  const Eigen::Vector3d by_unit = second.cam2_from_cam1.translation;
  predicted.covariance.bottomRightCorner<3, 3>() +=
      unit_log_sigma * unit_log_sigma * by_unit * by_unit.transpose();
  return TestPair(b.j_from_i, predicted, has_position).Probability() >=
         options.significance;
}

}  // namespace adasfm
