// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/street_grid.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace adasfm {
namespace {

// Smallest distance between the midpoints of streets that look alike.
constexpr double kMinTwinDistance = 55.0;
// Approximate number of aliased image pairs from one pair of streets.
constexpr int kNumAliasPairsPerTwin = 70;

// Height of the road at node i of the route.
double HeightAtNode(const SyntheticWorldOptions& options, size_t i) {
  return options.trajectory == SyntheticTrajectory::kFloors
             ? 0.25 * i * options.floor_height_m
             : 0.0;
}

class StreetBuilder {
 public:
  StreetBuilder(const SyntheticWorldOptions& options, Random* random,
                StreetGrid* grid)
      : options_(options), random_(*random), grid_(*grid) {}

  void Build() {
    const std::vector<GridNode>& nodes = grid_.route.nodes;
    if (options_.trajectory == SyntheticTrajectory::kFloors) {
      for (size_t i = 0; i + 1 < nodes.size(); ++i) AddFloorStreets(i);
      return;
    }
    for (size_t i = 0; i + 1 < nodes.size(); ++i) {
      Add(nodes[i], nodes[i + 1], 0);
      grid_.streets.back().is_driven = true;
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
      for (const GridNode& step : kSteps) {
        Add(node, {node[0] + step[0], node[1] + step[1]}, 0);
      }
    }
  }

 private:
  static constexpr GridNode kSteps[] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};

  Street* Add(const GridNode& from, const GridNode& to, int level) {
    const StreetId id = MakeStreetId(from, to, level);
    if (!grid_.street_from_id.emplace(id, grid_.streets.size()).second) {
      return nullptr;
    }
    Street street;
    street.from = from;
    street.to = to;
    street.layout_seed = random_.UniformInt(0, int64_t{1} << 62);
    grid_.streets.push_back(street);
    return &grid_.streets.back();
  }

  // Street i of the ramp, and the other streets that branch off at its begin.
  void AddFloorStreets(size_t i) {
    const GridNode& from = grid_.route.nodes[i];
    Street* street = Add(from, grid_.route.nodes[i + 1], i);
    street->is_driven = true;
    street->height_m = HeightAtNode(options_, i);
    street->slope =
        (HeightAtNode(options_, i + 1) - street->height_m) / kBlockSize;
    for (const GridNode& step : kSteps) {
      const GridNode to = {from[0] + step[0], from[1] + step[1]};
      if (std::clamp(to[0], 0, 1) == to[0] &&
          std::clamp(to[1], 0, 1) == to[1]) {
        continue;  // a street of the ramp
      }
      Add(from, to, i)->height_m = HeightAtNode(options_, i);
    }
  }

  const SyntheticWorldOptions& options_;
  Random& random_;
  StreetGrid& grid_;
};

// The streets that the images certainly reach, in the order of the route.
std::vector<int> ReachedStreets(const SyntheticWorldOptions& options,
                                const StreetGrid& grid) {
  const int reach = static_cast<int>(options.spacing_m *
                                     (options.num_images - 1) / kBlockSize);
  std::vector<int> streets;
  for (int i = 0; i < reach; ++i) {
    const bool has_levels = options.trajectory == SyntheticTrajectory::kFloors;
    const int street = grid.street_from_id.at(MakeStreetId(
        grid.route.nodes[i], grid.route.nodes[i + 1], has_levels ? i : 0));
    if (std::find(streets.begin(), streets.end(), street) == streets.end()) {
      streets.push_back(street);
    }
  }
  return streets;
}

// Joins two rings of streets that look alike; both get the layout of a.
void JoinTwins(int a, int b, std::vector<Street>* streets) {
  for (const int k : {a, b}) {
    if ((*streets)[k].twin < 0) (*streets)[k].twin = k;
  }
  int k = b;
  do {
    (*streets)[k].layout_seed = (*streets)[a].layout_seed;
    k = (*streets)[k].twin;
  } while (k != b);
  std::swap((*streets)[a].twin, (*streets)[b].twin);
}

// Joins pairs of streets first, then larger classes. Returns how many joins
// were made.
int MakeTwins(int num_twins, const std::vector<int>& reached, Random* random,
              std::vector<Street>* streets) {
  // Driven streets come first in the list, in the order of the route.
  std::vector<int> order = reached;
  std::sort(order.begin(), order.end());
  random->Shuffle(&order);
  int num_joined = 0;
  const auto join_all = [&](auto may_join) {
    for (const int a : order) {
      for (const int b : order) {
        const Street& first = (*streets)[a];
        const Street& second = (*streets)[b];
        if (num_joined == num_twins || a == b ||
            first.layout_seed == second.layout_seed ||
            !may_join(first, second) ||
            (first.Midpoint() - second.Midpoint()).norm() < kMinTwinDistance) {
          continue;
        }
        JoinTwins(a, b, streets);
        ++num_joined;
      }
    }
  };
  join_all([](const Street& a, const Street& b) {
    return a.twin < 0 && b.twin < 0;
  });
  join_all([](const Street&, const Street&) { return true; });
  return num_joined;
}

// Parallel streets: every period-th street of the route looks the same. Car
// park: streets at the same place of all floors look the same, also those that
// branch off.
void MakePeriodicTwins(const SyntheticWorldOptions& options, StreetGrid* grid) {
  std::vector<Street>& streets = grid->streets;
  if (options.trajectory == SyntheticTrajectory::kFloors) {
    std::map<std::array<GridNode, 2>, int> first;
    for (size_t i = 0; i < streets.size(); ++i) {
      const auto [it, is_new] =
          first.insert({{streets[i].from, streets[i].to}, static_cast<int>(i)});
      if (!is_new) JoinTwins(it->second, i, &streets);
    }
    return;
  }
  // The blocks of one street and the connection to the next one.
  const size_t period = options.street_num_blocks + 1;
  for (size_t i = period; i + 1 < grid->route.nodes.size(); ++i) {
    if ((i + 1) % period == 0) continue;
    JoinTwins(i % period, i, &streets);
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
                         uvz.z() + HeightAt(uvz.x()));
}

Eigen::Vector3d Street::LocalFromWorld(const Eigen::Vector3d& xyz) const {
  const Eigen::Vector2d offset = xyz.head<2>() - Origin();
  const Eigen::Vector2d d = Direction();
  const double u = d.dot(offset);
  return Eigen::Vector3d(u, d.x() * offset.y() - d.y() * offset.x(),
                         xyz.z() - HeightAt(u));
}

StreetId MakeStreetId(const GridNode& a, const GridNode& b, int level) {
  return {level, std::min(a, b), std::max(a, b)};
}

StreetGrid BuildStreetGrid(const SyntheticWorldOptions& options,
                           int num_twins) {
  StreetGrid grid;
  Random random = MakeRandom(options.seed, 1);
  grid.route = BuildRoute(options, &random);
  if (IsOnLawn(options)) {
    // The field is one "street" whose frame is that of the world.
    grid.streets.resize(1);
    grid.streets[0].to = {1, 0};
    return grid;
  }
  StreetBuilder(options, &random, &grid).Build();
  if (IsPeriodic(options)) {
    MakePeriodicTwins(options, &grid);
    return grid;
  }
  Random twin_random = MakeRandom(options.seed, 2);
  if (num_twins < 0) num_twins = FirstNumTwins(options);
  grid.can_have_more_twins =
      num_twins == MakeTwins(num_twins, ReachedStreets(options, grid),
                             &twin_random, &grid.streets);
  return grid;
}

int FirstNumTwins(const SyntheticWorldOptions& options) {
  const double num_alias_pairs = options.alias_pair_ratio * options.num_images *
                                 options.num_sequential_neighbors;
  return static_cast<int>(std::ceil(num_alias_pairs / kNumAliasPairsPerTwin));
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
