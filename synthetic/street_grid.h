// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "core/random.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// The town is a square grid of streets. Between the streets stand blocks of
// houses, squares that nobody can look through.
inline constexpr double kBlockSize = 60.0;       // between street axes, m
inline constexpr double kStreetHalfWidth = 7.0;  // axis to facade, m
inline constexpr double kMaxViewDistance = 60.0;

using GridNode = std::array<int, 2>;

// Crossings in the order in which the car passes them.
struct Route {
  std::vector<GridNode> nodes;
};

// One street between two crossings, with its own frame: u along the street
// in the direction in which it is first driven, v to the left, z up.
struct Street {
  GridNode from = {0, 0};
  GridNode to = {0, 0};
  // Equal layout seeds give equal facades.
  uint64_t layout_seed = 0;
  // The street that looks the same, or -1.
  int twin = -1;
  bool is_driven = false;

  Eigen::Vector2d Origin() const {
    return kBlockSize * Eigen::Vector2d(from[0], from[1]);
  }
  Eigen::Vector2d Direction() const {
    return Eigen::Vector2d(to[0] - from[0], to[1] - from[1]);
  }
  Eigen::Vector2d Midpoint() const {
    return Origin() + 0.5 * kBlockSize * Direction();
  }
  Eigen::Vector3d WorldFromLocal(const Eigen::Vector3d& uvz) const;
  Eigen::Vector3d LocalFromWorld(const Eigen::Vector3d& xyz) const;
};

// A crossing pair with the smaller one first.
std::pair<GridNode, GridNode> StreetKey(const GridNode& a, const GridNode& b);

struct StreetGrid {
  Route route;
  std::vector<Street> streets;
  std::map<std::pair<GridNode, GridNode>, int> street_from_key;
};

// A random walk long enough for the drive, and all streets that it can see.
// Streets become twins as far as look-alike places are asked for.
StreetGrid BuildStreetGrid(const SyntheticWorldOptions& options);

// Whether no block stands between two points (heights do not matter).
bool HasLineOfSight(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

// A generator for one purpose, independent of those of other purposes.
Random MakeRandom(uint64_t seed, uint64_t stream, uint64_t substream = 0);

}  // namespace adasfm
