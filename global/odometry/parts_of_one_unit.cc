// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/parts_of_one_unit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

#include "core/disjoint_sets.h"
#include "global/odometry/length_propagation.h"
#include "global/odometry/sizes_by_closure.h"

namespace adasfm {
namespace {

// For each place, the sets that contain it. Images that a standstill joins are
// one place, that of the first of them; others are one each.
using Memberships = std::vector<std::set<int>>;

DisjointSets FindPlaces(const ViewGraph& graph) {
  DisjointSets places(graph.images.size());
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsJoinAtRest()) continue;
    places.Join(graph.IndexOf(edge.image_id2), graph.IndexOf(edge.image_id1));
  }
  return places;
}

// One set per unit, the first one of metres. shape_sigmas: by set, the least
// direction sigma of its edges.
Memberships CollectUnits(const ViewGraph& graph, const std::vector<int>& units,
                         DisjointSets* places,
                         std::vector<double>* shape_sigmas) {
  Memberships sets_of(graph.images.size());
  std::map<int, int> set_of_unit;
  const auto number = [&set_of_unit](int unit) {
    const int next = static_cast<int>(set_of_unit.size());
    return set_of_unit.emplace(unit, next).first->second;
  };
  constexpr int kMetres = -1;
  number(kMetres);
  shape_sigmas->assign(graph.edges.size() + 1, 1.0);
  const auto add = [&](const ViewGraphEdge& edge, int set) {
    double& sigma = (*shape_sigmas)[set];
    sigma = std::min(sigma, edge.direction_sigma_rad);
    sets_of[places->Find(graph.IndexOf(edge.image_id1))].insert(set);
    sets_of[places->Find(graph.IndexOf(edge.image_id2))].insert(set);
  };
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewGraphEdge& edge = graph.edges[e];
    if (!edge.IsKept()) continue;
    if (edge.length_m) add(edge, number(kMetres));
    if (units[e] >= 0) add(edge, number(units[e]));
  }
  shape_sigmas->resize(set_of_unit.size());
  return sets_of;
}

// Replaces joined sets by the first of them.
void TakeRoots(DisjointSets* joined, Memberships* sets_of) {
  for (std::set<int>& sets : *sets_of) {
    std::set<int> roots;
    for (const int set : sets) roots.insert(joined->Find(set));
    sets = std::move(roots);
  }
}

// Joins sets that share two places. Returns whether there were any.
bool JoinSetsOfOneSize(Memberships* sets_of, int num_sets) {
  std::map<std::pair<int, int>, int> num_shared;
  for (const std::set<int>& sets : *sets_of) {
    for (auto a = sets.begin(); a != sets.end(); ++a) {
      for (auto b = std::next(a); b != sets.end(); ++b) {
        ++num_shared[{*a, *b}];
      }
    }
  }
  DisjointSets joined(num_sets);
  bool any = false;
  for (const auto& [pair, count] : num_shared) {
    if (count < 2) continue;
    any = true;
    joined.Join(pair.second, pair.first);
  }
  TakeRoots(&joined, sets_of);
  return any;
}

// Least sigma of a shape, as a share of its extent: that of a direction known
// to 0.3 deg.
constexpr double kMinShapeSigma = 0.005;

// Joins sets whose scales rings of sets determine. Returns whether there were
// any.
bool JoinSetsByClosure(
    const std::vector<double>& shape_sigmas,
    const std::vector<std::optional<Eigen::Vector3d>>& centers,
    Memberships* sets_of) {
  std::vector<SizedSet> sets(shape_sigmas.size());
  for (size_t i = 0; i < sets_of->size(); ++i) {
    for (const int set : (*sets_of)[i]) sets[set].images.push_back(i);
  }
  for (size_t k = 0; k < sets.size(); ++k) {
    sets[k].shape_sigma = std::max(kMinShapeSigma, shape_sigmas[k]);
  }
  DisjointSets joined(static_cast<int>(sets.size()));
  const auto pairs = FindSizesByClosure(sets, centers);
  for (const auto& [a, b] : pairs) joined.Join(b, a);
  TakeRoots(&joined, sets_of);
  return !pairs.empty();
}

// The largest of the sets that a place is in; -1 where there is none.
std::vector<int> ChooseLargest(const Memberships& sets_of, int num_sets) {
  std::vector<int> sizes(num_sets, 0);
  for (const std::set<int>& sets : sets_of) {
    for (const int set : sets) ++sizes[set];
  }
  std::vector<int> part_of;
  for (const std::set<int>& sets : sets_of) {
    const auto largest = std::max_element(
        sets.begin(), sets.end(),
        [&sizes](int a, int b) { return sizes[a] < sizes[b]; });
    part_of.push_back(largest == sets.end() ? -1 : *largest);
  }
  return part_of;
}

// Images without a part join a neighbour's part, strongest edges first.
void JoinTheRest(const ViewGraph& graph, std::vector<int>* part_of) {
  std::vector<std::vector<std::pair<int, int>>> neighbors(graph.images.size());
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept()) continue;
    const int i = graph.IndexOf(edge.image_id1);
    const int j = graph.IndexOf(edge.image_id2);
    neighbors[i].emplace_back(edge.num_inliers, j);
    neighbors[j].emplace_back(edge.num_inliers, i);
  }
  std::priority_queue<std::tuple<int, int, int>> queue;  // inliers, image, part
  const auto announce = [&](int i) {
    for (const auto& [num_inliers, j] : neighbors[i]) {
      if ((*part_of)[j] < 0) queue.emplace(num_inliers, j, (*part_of)[i]);
    }
  };
  for (size_t i = 0; i < part_of->size(); ++i) {
    if ((*part_of)[i] >= 0) announce(i);
  }
  while (!queue.empty()) {
    const auto [num_inliers, i, part] = queue.top();
    queue.pop();
    if ((*part_of)[i] >= 0) continue;
    (*part_of)[i] = part;
    announce(i);
  }
}

// Images without a part, near no edge with a length, form one part.
std::vector<int> NameByFirstImage(const std::vector<int>& part_of) {
  std::map<int, int> names;
  std::vector<int> named;
  for (size_t i = 0; i < part_of.size(); ++i) {
    named.push_back(
        names.emplace(part_of[i], static_cast<int>(i)).first->second);
  }
  return named;
}

}  // namespace

std::vector<int> FindLengthUnits(
    int num_threads, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences, const EdgeLengths& lengths) {
  // All matches: the best of each pair need not be those that pairs share.
  LengthPropagation propagation(std::numeric_limits<int>::max(), num_threads,
                                graph, correspondences);
  for (size_t e = 0; e < lengths.lengths.size(); ++e) {
    if (!lengths.lengths[e]) continue;
    const EdgeLength& length = *lengths.lengths[e];
    if (known_lengths_m.count(graph.edges[e].Pair()) > 0) {
      propagation.Fix(e, std::log(length.length), length.log_sigma);
    } else {
      propagation.Start(e, length);
    }
  }
  propagation.Spread(LengthPropagation::kMinNumShared);
  return propagation.FindUnits();
}

std::vector<int> FindPartsOfOneUnit(
    const ViewGraph& graph, const std::vector<int>& units,
    const std::map<image_t, Eigen::Vector3d>& centers) {
  std::vector<std::optional<Eigen::Vector3d>> center_of;
  for (const image_t image : graph.images) {
    const auto center = centers.find(image);
    center_of.emplace_back();
    if (center != centers.end()) center_of.back() = center->second;
  }
  std::vector<double> shape_sigmas;
  DisjointSets places = FindPlaces(graph);
  Memberships sets_of = CollectUnits(graph, units, &places, &shape_sigmas);
  const int num_sets = static_cast<int>(shape_sigmas.size());
  while (JoinSetsOfOneSize(&sets_of, num_sets) ||
         JoinSetsByClosure(shape_sigmas, center_of, &sets_of)) {
  }
  std::vector<int> part_of = ChooseLargest(sets_of, num_sets);
  for (size_t i = 0; i < part_of.size(); ++i)
    part_of[i] = part_of[places.Find(i)];
  JoinTheRest(graph, &part_of);
  return NameByFirstImage(part_of);
}

}  // namespace adasfm
