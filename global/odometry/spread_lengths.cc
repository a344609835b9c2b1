// SPDX-License-Identifier: BSD-3-Clause
#include <map>
#include <queue>
#include <utility>
#include <vector>

#include "global/odometry/length_propagation.h"

namespace adasfm {

void LengthPropagation::Spread(int min_num_shared) {
  // Number of shared keypoints, -edge.
  std::priority_queue<std::pair<int, int>> queue;
  std::vector<int> num_shared(graph_.edges.size(), 0);
  std::vector<char> has_depth(num_known_.size(), false);
  // Edges that share more than when they were last put into the queue.
  std::vector<int> grown;
  std::vector<char> has_grown(graph_.edges.size(), false);
  const auto announce = [&](int edge) {
    for (size_t o = edge_begin_[edge]; o < edge_begin_[edge + 1]; ++o) {
      const int keypoint = observations_[o].keypoint;
      if (has_depth[keypoint]) continue;
      has_depth[keypoint] = true;
      for (size_t k = link_begin_[keypoint]; k < link_begin_[keypoint + 1];
           ++k) {
        const int other = links_[k].edge;
        if (is_known_[other]) continue;
        if (++num_shared[other] < min_num_shared || has_grown[other]) continue;
        has_grown[other] = true;
        grown.push_back(other);
      }
    }
  };
  const auto enqueue = [&] {
    for (const int edge : grown) {
      queue.emplace(num_shared[edge], -edge);
      has_grown[edge] = false;
    }
    grown.clear();
  };
  const int num_edges = graph_.edges.size();
  for (int e = 0; e < num_edges; ++e) {
    if (is_known_[e]) announce(e);
  }
  enqueue();
  // How many keypoints an edge shared when its length was last rejected.
  std::vector<int> num_refused(num_edges, 0);
  while (!queue.empty()) {
    const auto [count, negative] = queue.top();
    queue.pop();
    const int e = -negative;
    if (is_known_[e] || count <= num_refused[e]) continue;
    if (LearnFromStart(e)) {
      announce(e);
      enqueue();
    } else {
      num_refused[e] = num_shared[e];
    }
  }
}

// The depth of a keypoint by its known edges, computed anew only when their
// number has grown by more than half.
double LengthPropagation::StartingDepth(int keypoint) {
  if (2 * num_known_[keypoint] <= 3 * num_known_at_depth_[keypoint]) {
    return log_depths_[keypoint];
  }
  std::vector<WeightedValue> values;
  for (size_t k = link_begin_[keypoint]; k < link_begin_[keypoint + 1]; ++k) {
    const Link& link = links_[k];
    if (!is_known_[link.edge]) continue;
    const Observation& observation = observations_[link.observation];
    values.push_back(
        {log_lengths_[link.edge] + observation.offset, observation.weight});
  }
  num_known_at_depth_[keypoint] = num_known_[keypoint];
  log_depths_[keypoint] = WeightedMedian(&values);
  return log_depths_[keypoint];
}

bool LengthPropagation::LearnFromStart(int edge) {
  std::vector<WeightedValue> values;
  for (size_t o = edge_begin_[edge]; o < edge_begin_[edge + 1]; ++o) {
    const Observation& observation = observations_[o];
    if (num_known_[observation.keypoint] == 0) continue;
    values.push_back({StartingDepth(observation.keypoint) - observation.offset,
                      observation.weight});
  }
  EdgeLength learned;
  if (!LearnLength(&values, &learned)) return false;
  log_lengths_[edge] = learned.length;
  log_sigmas_[edge] = learned.log_sigma;
  MarkKnown(edge);
  return true;
}

std::vector<int> LengthPropagation::FindUnitsOfKnownSize(
    int edge, DisjointSets* sets) const {
  // At this sigma a lane of 10 m errs by half a metre.
  constexpr double kMaxSizeLogSigma = 0.05;
  // A few wrong matches agree by chance; the spread of this many keypoints
  // determines the sigma to a third.
  constexpr size_t kMinNumShared = 12;
  // By unit: log ratios of the keypoints' depths to those by the edge itself.
  std::map<int, std::vector<WeightedValue>> depths;
  for (size_t o = edge_begin_[edge]; o < edge_begin_[edge + 1]; ++o) {
    const Observation& own = observations_[o];
    std::map<int, std::vector<WeightedValue>> of_keypoint;
    for (size_t k = link_begin_[own.keypoint];
         k < link_begin_[own.keypoint + 1]; ++k) {
      const Link& link = links_[k];
      if (!is_known_[link.edge] || sets->Find(link.edge) == sets->Find(edge)) {
        continue;
      }
      const Observation& observation = observations_[link.observation];
      of_keypoint[sets->Find(link.edge)].push_back(
          {log_lengths_[link.edge] + observation.offset, observation.weight});
    }
    for (auto& [unit, values] : of_keypoint) {
      depths[unit].push_back(
          {WeightedMedian(&values) - log_lengths_[edge] - own.offset,
           own.weight});
    }
  }
  std::vector<int> units;
  for (auto& [unit, values] : depths) {
    EdgeLength ratio;
    if (values.size() >= kMinNumShared && LearnLength(&values, &ratio) &&
        ratio.log_sigma <= kMaxSizeLogSigma) {
      units.push_back(unit);
    }
  }
  return units;
}

std::vector<int> LengthPropagation::FindUnits() const {
  const int num_edges = graph_.edges.size();
  DisjointSets sets(num_edges);
  int first_fixed = -1;
  for (int e = 0; e < num_edges; ++e) {
    if (!is_fixed_[e]) continue;
    if (first_fixed < 0) first_fixed = e;
    sets.Join(e, first_fixed);
  }
  for (bool has_changed = true; has_changed;) {
    has_changed = false;
    for (int e = 0; e < num_edges; ++e) {
      if (!is_known_[e]) continue;
      for (const int unit : FindUnitsOfKnownSize(e, &sets)) {
        sets.Join(e, unit);
        has_changed = true;
      }
    }
  }
  std::vector<int> units(num_edges, -1);
  for (int e = 0; e < num_edges; ++e) {
    if (is_known_[e] || NumMatches(e) >= kMinNumShared) {
      units[e] = sets.Find(e);
    }
  }
  return units;
}

}  // namespace adasfm
