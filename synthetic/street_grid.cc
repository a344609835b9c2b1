// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/street_grid.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

namespace adasfm {
namespace {

// Look-alike streets are at least this far apart (between their middles).
constexpr double kMinTwinDistance = 55.0;
// About as many look-alike image pairs come from one pair of streets.
constexpr int kNumAliasPairsPerTwin = 70;

int NumRouteNodes(const SyntheticWorldOptions& options) {
  const double length = options.spacing_m * options.num_images + 100.0;
  // Bends cut corners: a street is driven in a little less than its length.
  return static_cast<int>(std::ceil(length / (kBlockSize - 5.0))) + 3;
}

Route BuildStraightRoute(int num_nodes) {
  Route route;
  for (int i = 0; i < num_nodes; ++i) route.nodes.push_back({i, 0});
  return route;
}

// A walk that never turns back, in a town of a size that the walk has to come
// back to streets driven before. It likes to meet its own way, follows it for
// one or two streets, and leaves it again.
class TownWalk {
 public:
  TownWalk(int num_nodes, Random* random)
      : num_nodes_(num_nodes),
        size_(std::max(
            3, static_cast<int>(std::lround(std::sqrt(0.5 * num_nodes))))),
        random_(random) {}

  Route Build() {
    Route route;
    GridNode node = {0, 0};
    GridNode step = {0, 1};
    route.nodes.push_back(node);
    while (static_cast<int>(route.nodes.size()) < num_nodes_) {
      const GridNode next = {node[0] + step[0], node[1] + step[1]};
      const bool is_repeat = !driven_.insert({node, next}).second;
      num_repeats_ = is_repeat ? num_repeats_ + 1 : 0;
      visited_.insert(node);
      node = next;
      route.nodes.push_back(node);
      step = ChooseStep(node, step);
    }
    return route;
  }

 private:
  GridNode ChooseStep(const GridNode& node, const GridNode& step) {
    std::vector<GridNode> choices;
    for (const GridNode& choice :
         {step, GridNode{-step[1], step[0]}, GridNode{step[1], -step[0]}}) {
      const GridNode next = {node[0] + choice[0], node[1] + choice[1]};
      if (std::min(next[0], next[1]) < 0 ||
          std::max(next[0], next[1]) >= size_) {
        continue;
      }
      int weight = visited_.count(next) > 0 ? 3 : 1;
      if (driven_.count({node, next}) > 0) weight = num_repeats_ < 2 ? 10 : 1;
      choices.insert(choices.end(), weight, choice);
    }
    return choices[random_->UniformInt(0, choices.size() - 1)];
  }

  int num_nodes_;
  int size_;
  Random* random_;
  std::set<GridNode> visited_;
  std::set<std::pair<GridNode, GridNode>> driven_;
  int num_repeats_ = 0;
};

void AddStreet(const GridNode& from, const GridNode& to, bool is_driven,
               Random* random, StreetGrid* grid) {
  const auto key = StreetKey(from, to);
  if (grid->street_from_key.count(key) > 0) return;
  grid->street_from_key[key] = static_cast<int>(grid->streets.size());
  Street street;
  street.from = from;
  street.to = to;
  street.is_driven = is_driven;
  street.layout_seed = random->UniformInt(0, int64_t{1} << 62);
  grid->streets.push_back(street);
}

void AddStreets(Random* random, StreetGrid* grid) {
  const std::vector<GridNode>& nodes = grid->route.nodes;
  for (size_t i = 0; i + 1 < nodes.size(); ++i) {
    AddStreet(nodes[i], nodes[i + 1], true, random, grid);
  }
  // All streets within view of the route.
  std::set<GridNode> near;
  for (const GridNode& node : nodes) {
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        near.insert({node[0] + dx, node[1] + dy});
      }
    }
  }
  for (const GridNode& node : near) {
    for (const GridNode& step :
         {GridNode{-1, 0}, GridNode{1, 0}, GridNode{0, -1}, GridNode{0, 1}}) {
      AddStreet(node, {node[0] + step[0], node[1] + step[1]}, false, random,
                grid);
    }
  }
}

// How many streets of the route the images certainly reach.
int NumDrivenStreets(const SyntheticWorldOptions& options,
                     const StreetGrid& grid) {
  const int reach = static_cast<int>(options.spacing_m *
                                     (options.num_images - 1) / kBlockSize);
  std::set<int> streets;
  for (int i = 0; i < reach; ++i) {
    streets.insert(grid.street_from_key.at(
        StreetKey(grid.route.nodes[i], grid.route.nodes[i + 1])));
  }
  return static_cast<int>(streets.size());
}

void MakeTwins(const SyntheticWorldOptions& options, Random* random,
               StreetGrid* grid) {
  const double num_alias_pairs = options.alias_pair_ratio * options.num_images *
                                 options.num_sequential_neighbors;
  int num_twins =
      static_cast<int>(std::ceil(num_alias_pairs / kNumAliasPairsPerTwin));
  if (num_twins == 0) return;
  // Driven streets come first in the list, in the order of the route.
  std::vector<int> order(NumDrivenStreets(options, *grid));
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  random->Shuffle(&order);
  bool has_twins = false;
  for (const int a : order) {
    for (const int b : order) {
      Street& first = grid->streets[a];
      Street& second = grid->streets[b];
      if (num_twins == 0 || first.twin >= 0 || second.twin >= 0 || a == b ||
          (first.Midpoint() - second.Midpoint()).norm() < kMinTwinDistance) {
        continue;
      }
      first.twin = b;
      second.twin = a;
      second.layout_seed = first.layout_seed;
      has_twins = true;
      --num_twins;
    }
  }
  if (!has_twins) {
    throw std::invalid_argument(
        "SyntheticWorldOptions: alias_pair_ratio needs a longer drive, of at "
        "least three streets of 60 m");
  }
}

// Whether the segment passes through the block (by slabs).
bool CrossesBlock(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                  int column, int row) {
  // Points on the facade itself are outside.
  const double margin = kStreetHalfWidth + 0.01;
  const double low[2] = {column * kBlockSize + margin,
                         row * kBlockSize + margin};
  const double size = kBlockSize - 2.0 * margin;
  double enter = 0.0;
  double leave = 1.0;
  for (int k = 0; k < 2; ++k) {
    const double step = to[k] - from[k];
    if (std::abs(step) < 1e-12) {
      if (from[k] <= low[k] || from[k] >= low[k] + size) return false;
      continue;
    }
    const double a = (low[k] - from[k]) / step;
    const double b = (low[k] + size - from[k]) / step;
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter < leave;
}

}  // namespace

Eigen::Vector3d Street::WorldFromLocal(const Eigen::Vector3d& uvz) const {
  const Eigen::Vector2d origin = Origin();
  const Eigen::Vector2d d = Direction();
  return Eigen::Vector3d(origin.x() + d.x() * uvz.x() - d.y() * uvz.y(),
                         origin.y() + d.y() * uvz.x() + d.x() * uvz.y(),
                         uvz.z());
}

Eigen::Vector3d Street::LocalFromWorld(const Eigen::Vector3d& xyz) const {
  const Eigen::Vector2d offset = xyz.head<2>() - Origin();
  const Eigen::Vector2d d = Direction();
  return Eigen::Vector3d(d.dot(offset), d.x() * offset.y() - d.y() * offset.x(),
                         xyz.z());
}

std::pair<GridNode, GridNode> StreetKey(const GridNode& a, const GridNode& b) {
  return a < b ? std::make_pair(a, b) : std::make_pair(b, a);
}

StreetGrid BuildStreetGrid(const SyntheticWorldOptions& options) {
  StreetGrid grid;
  Random random = MakeRandom(options.seed, 1);
  const int num_nodes = NumRouteNodes(options);
  grid.route = options.trajectory == SyntheticTrajectory::kStraight
                   ? BuildStraightRoute(num_nodes)
                   : TownWalk(num_nodes, &random).Build();
  AddStreets(&random, &grid);
  Random twin_random = MakeRandom(options.seed, 2);
  MakeTwins(options, &twin_random, &grid);
  return grid;
}

bool HasLineOfSight(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d low = from.cwiseMin(to) / kBlockSize;
  const Eigen::Vector2d high = from.cwiseMax(to) / kBlockSize;
  for (int i = std::floor(low.x()); i <= std::floor(high.x()); ++i) {
    for (int j = std::floor(low.y()); j <= std::floor(high.y()); ++j) {
      if (CrossesBlock(from, to, i, j)) return false;
    }
  }
  return true;
}

Random MakeRandom(uint64_t seed, uint64_t stream, uint64_t substream) {
  // SplitMix64's finaliser keeps neighbouring seeds and streams apart.
  uint64_t state = seed;
  for (const uint64_t value : {stream, substream}) {
    state += 0x9e3779b97f4a7c15ull * (value + 1);
    state = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9ull;
    state = (state ^ (state >> 27)) * 0x94d049bb133111ebull;
    state ^= state >> 31;
  }
  return Random(state);
}

}  // namespace adasfm
