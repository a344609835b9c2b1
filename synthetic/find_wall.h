// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>

#include "synthetic/street_grid.h"

namespace adasfm {

// Only haze is drawn beyond this distance [m].
inline constexpr double kViewLimit = 250.0;

struct WallHit {
  double distance = std::numeric_limits<double>::infinity();
  // The crossings at the ends of the street that the wall belongs to.
  GridNode from = {0, 0};
  GridNode to = {0, 0};
};

// The first facade of the grid's blocks that a ray hits, seen from above. from
// [m] and direction (of any length) are in the world; distances are in lengths
// of the direction, infinite when no facade is found within kViewLimit.
WallHit FindWall(const Eigen::Vector2d& from, const Eigen::Vector2d& direction);

}  // namespace adasfm
