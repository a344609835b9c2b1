// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <tuple>
#include <vector>

#include "core/random.h"
#include "synthetic/routes.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// The town is a square grid of streets, with opaque square blocks of houses
// between them.
inline constexpr double kStreetHalfWidth = 7.0;  // axis to facade, m
inline constexpr double kMaxViewDistance = 60.0;

// One street between two crossings, with its own frame: u along the street
// in the direction in which it is first driven, v to the left, z up.
struct Street {
  GridNode from = {0, 0};
  GridNode to = {0, 0};
  // Equal layout seeds give equal facades.
  uint64_t layout_seed = 0;
  // The next street in the ring of streets that look alike, or -1.
  int twin = -1;
  bool is_driven = false;
  // Height of the road at u = 0, and its slope along u.
  double height_m = 0.0;
  double slope = 0.0;

  double HeightAt(double u) const { return height_m + slope * u; }

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

// Level and crossings, the smaller one first.
using StreetId = std::tuple<int, GridNode, GridNode>;
StreetId MakeStreetId(const GridNode& a, const GridNode& b, int level = 0);

struct StreetGrid {
  Route route;
  std::vector<Street> streets;
  std::map<StreetId, int> street_from_id;
  // A larger num_twins makes more streets look alike.
  bool can_have_more_twins = false;
};

// The route and all streets visible from it; on a lawn, one field. num_twins
// times two streets are made to look alike, pairs first, then larger classes;
// parallel streets and the floors of a car park always look alike. -1:
// FirstNumTwins.
StreetGrid BuildStreetGrid(const SyntheticWorldOptions& options,
                           int num_twins = -1);

// Approximate num_twins that options.alias_pair_ratio needs.
int FirstNumTwins(const SyntheticWorldOptions& options);

// Whether no block stands between two points (heights do not matter).
bool HasLineOfSight(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

// A generator for one purpose, independent of those of other purposes.
Random MakeRandom(uint64_t seed, uint64_t stream, uint64_t substream = 0);

}  // namespace adasfm
