// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/find_unverified_joins.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// A pair between two pieces; the first image lies in the first one.
struct Crossing {
  int piece1 = 0;  // < piece2
  int piece2 = 0;
  int64_t rank1 = 0;
  int64_t rank2 = 0;
  const ViewGraphEdge* edge = nullptr;
};

// Neighbouring crossings of the same two pieces.
struct Place {
  int piece1 = 0;
  int piece2 = 0;
  UnverifiedJoin join;
  int max_num_inliers = -1;
};

// A gyroscope alone does not.
bool TellsPlace(const ViewGraphEdge& edge) {
  return edge.IsKept() && edge.has_translation;
}

std::vector<Crossing> CollectCrossings(const ViewGraph& graph, int max_gap,
                                       std::vector<int>* piece_of) {
  DisjointSets sets(graph.images.size());
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!TellsPlace(edge)) continue;
    if (edge.source == EdgeSource::kVisual &&
        graph.CaptureGap(edge) > max_gap) {
      continue;
    }
    sets.Join(graph.IndexOf(edge.image_id1), graph.IndexOf(edge.image_id2));
  }
  for (size_t i = 0; i < graph.images.size(); ++i) {
    piece_of->push_back(sets.Find(i));
  }
  std::vector<Crossing> crossings;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!TellsPlace(edge)) continue;
    const int i = graph.IndexOf(edge.image_id1);
    const int j = graph.IndexOf(edge.image_id2);
    Crossing crossing{(*piece_of)[i], (*piece_of)[j], graph.CaptureRank(i),
                      graph.CaptureRank(j), &edge};
    if (crossing.piece1 > crossing.piece2) {
      std::swap(crossing.piece1, crossing.piece2);
      std::swap(crossing.rank1, crossing.rank2);
    }
    if (crossing.piece1 != crossing.piece2) crossings.push_back(crossing);
  }
  std::sort(crossings.begin(), crossings.end(),
            [](const Crossing& a, const Crossing& b) {
              return std::tie(a.piece1, a.piece2, a.rank1, a.rank2) <
                     std::tie(b.piece1, b.piece2, b.rank1, b.rank2);
            });
  return crossings;
}

std::vector<Place> GroupCrossings(const std::vector<Crossing>& crossings,
                                  int max_gap) {
  DisjointSets sets(crossings.size());
  for (size_t a = 0; a < crossings.size(); ++a) {
    for (size_t b = a + 1; b < crossings.size(); ++b) {
      if (crossings[b].piece1 != crossings[a].piece1 ||
          crossings[b].piece2 != crossings[a].piece2 ||
          crossings[b].rank1 - crossings[a].rank1 > max_gap) {
        break;
      }
      if (std::abs(crossings[b].rank2 - crossings[a].rank2) <= max_gap) {
        sets.Join(b, a);
      }
    }
  }
  std::vector<int> place_of(crossings.size(), -1);
  std::vector<Place> places;
  for (size_t a = 0; a < crossings.size(); ++a) {
    int& index = place_of[sets.Find(a)];
    if (index < 0) {
      index = places.size();
      places.push_back({crossings[a].piece1, crossings[a].piece2, {}, -1});
    }
    Place& place = places[index];
    ++place.join.num_pairs;
    const ViewGraphEdge& edge = *crossings[a].edge;
    if (edge.num_inliers <= place.max_num_inliers) continue;
    place.max_num_inliers = edge.num_inliers;
    place.join.image_id1 = edge.image_id1;
    place.join.image_id2 = edge.image_id2;
  }
  return places;
}

// A spanning forest of the pieces, breadth first.
struct Forest {
  std::vector<int> order;
  std::vector<int> parent;        // piece, -1: root or no piece
  std::vector<int> parent_place;  // that leads there
  std::vector<int> depth;
};

Forest BuildForest(const std::vector<Place>& places,
                   const std::vector<int>& piece_of) {
  const size_t size = piece_of.size();
  std::vector<std::vector<int>> places_of(size);
  for (size_t k = 0; k < places.size(); ++k) {
    places_of[places[k].piece1].push_back(k);
    places_of[places[k].piece2].push_back(k);
  }
  Forest forest{{},
                std::vector<int>(size, -1),
                std::vector<int>(size, -1),
                std::vector<int>(size, -1)};
  for (size_t root = 0; root < size; ++root) {
    if (piece_of[root] != static_cast<int>(root) || forest.depth[root] >= 0) {
      continue;
    }
    forest.depth[root] = 0;
    forest.order.push_back(root);
    for (size_t head = forest.order.size() - 1; head < forest.order.size();
         ++head) {
      const int piece = forest.order[head];
      for (const int k : places_of[piece]) {
        const int other =
            places[k].piece1 == piece ? places[k].piece2 : places[k].piece1;
        if (forest.depth[other] >= 0) continue;
        forest.depth[other] = forest.depth[piece] + 1;
        forest.parent[other] = piece;
        forest.parent_place[other] = k;
        forest.order.push_back(other);
      }
    }
  }
  return forest;
}

// Pieces that several places hold together share a set; its representative is
// the one nearest to the root.
DisjointSets JoinConfirmedPieces(const std::vector<Place>& places,
                                 const Forest& forest) {
  DisjointSets sets(forest.parent.size());
  for (size_t k = 0; k < places.size(); ++k) {
    int a = sets.Find(places[k].piece1);
    int b = sets.Find(places[k].piece2);
    if (forest.parent_place[places[k].piece1] == static_cast<int>(k) ||
        forest.parent_place[places[k].piece2] == static_cast<int>(k)) {
      continue;
    }
    while (a != b) {
      int& deeper = forest.depth[a] >= forest.depth[b] ? a : b;
      sets.Join(deeper, forest.parent[deeper]);
      deeper = sets.Find(deeper);
    }
  }
  return sets;
}

}  // namespace

bool UnverifiedJoinOptions::IsValid(std::string* error) const {
  if (max_sequence_gap < 1 || min_num_images < 1) {
    *error = "max_sequence_gap = " + std::to_string(max_sequence_gap) +
             " and min_num_images = " + std::to_string(min_num_images) +
             " must be >= 1";
    return false;
  }
  return true;
}

std::vector<UnverifiedJoin> FindUnverifiedJoins(
    const UnverifiedJoinOptions& options, const ViewGraph& graph) {
  std::string error;
  if (!options.IsValid(&error)) {
    throw std::invalid_argument("FindUnverifiedJoins: " + error);
  }
  std::vector<int> piece_of;
  const std::vector<Place> places = GroupCrossings(
      CollectCrossings(graph, options.max_sequence_gap, &piece_of),
      options.max_sequence_gap);
  const Forest forest = BuildForest(places, piece_of);
  DisjointSets confirmed = JoinConfirmedPieces(places, forest);

  // Images below each piece, and below the root of its tree.
  std::vector<int> num_images(piece_of.size(), 0);
  for (const int piece : piece_of) ++num_images[piece];
  for (size_t k = forest.order.size(); k-- > 0;) {
    const int piece = forest.order[k];
    if (forest.parent[piece] >= 0) {
      num_images[forest.parent[piece]] += num_images[piece];
    }
  }
  std::vector<UnverifiedJoin> joins;
  std::vector<int> root_of(piece_of.size(), -1);
  for (const int piece : forest.order) {
    const int parent = forest.parent[piece];
    root_of[piece] = parent < 0 ? piece : root_of[parent];
    if (parent < 0 || confirmed.Find(piece) == confirmed.Find(parent)) continue;
    UnverifiedJoin join = places[forest.parent_place[piece]].join;
    join.num_images = std::min(num_images[piece],
                               num_images[root_of[piece]] - num_images[piece]);
    if (join.num_images >= options.min_num_images) joins.push_back(join);
  }
  std::sort(joins.begin(), joins.end(),
            [](const UnverifiedJoin& a, const UnverifiedJoin& b) {
              return std::tie(a.image_id1, a.image_id2) <
                     std::tie(b.image_id1, b.image_id2);
            });
  return joins;
}

}  // namespace adasfm
