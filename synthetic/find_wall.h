// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>

#include "synthetic/street_grid.h"

namespace adasfm {

// Beyond it nothing is drawn but haze [m].
inline constexpr double kViewLimit = 250.0;

struct WallHit {
  double distance = std::numeric_limits<double>::infinity();
  // The crossings at the ends of the street that the wall belongs to.
  GridNode from = {0, 0};
  GridNode to = {0, 0};
};

// The first facade of the grid's blocks that a ray meets, seen from above.
// from [m] and direction (of any length) in the world; distances are in lengths
// of the direction, infinite beyond kViewLimit.
WallHit FindWall(const Eigen::Vector2d& from, const Eigen::Vector2d& direction);

}  // namespace adasfm
