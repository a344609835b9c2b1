// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/find_wall.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace adasfm {
namespace {

// Intersects the ray with one block; distances in lengths of the direction.
bool HitBlock(const Eigen::Vector2d& from, const Eigen::Vector2d& direction,
              int column, int row, WallHit* hit) {
  const int cell[2] = {column, row};
  double enter = 0.0;
  double leave = std::numeric_limits<double>::infinity();
  int axis = -1;
  for (int k = 0; k < 2; ++k) {
    const double low = cell[k] * kBlockSize + kStreetHalfWidth;
    const double high = (cell[k] + 1) * kBlockSize - kStreetHalfWidth;
    if (std::abs(direction[k]) < 1e-12) {
      if (from[k] <= low || from[k] >= high) return false;
      continue;
    }
    double a = (low - from[k]) / direction[k];
    double b = (high - from[k]) / direction[k];
    if (a > b) std::swap(a, b);
    if (a > enter) {
      enter = a;
      axis = k;
    }
    leave = std::min(leave, b);
  }
  if (axis < 0 || enter >= leave) return false;
  hit->distance = enter;
  hit->from = {column, row};
  if (direction[axis] < 0.0) ++hit->from[axis];
  hit->to = hit->from;
  ++hit->to[1 - axis];
  return true;
}

}  // namespace

WallHit FindWall(const Eigen::Vector2d& from,
                 const Eigen::Vector2d& direction) {
  WallHit hit;
  int cell[2];
  double next[2];
  double step[2];
  for (int k = 0; k < 2; ++k) {
    cell[k] = static_cast<int>(std::floor(from[k] / kBlockSize));
    const double edge = (cell[k] + (direction[k] > 0.0)) * kBlockSize;
    const bool moves = std::abs(direction[k]) > 1e-12;
    const double infinity = std::numeric_limits<double>::infinity();
    next[k] = moves ? (edge - from[k]) / direction[k] : infinity;
    step[k] = moves ? kBlockSize / std::abs(direction[k]) : infinity;
  }
  double distance = 0.0;
  const double limit = kViewLimit / std::max(direction.norm(), 1e-9);
  while (distance < limit) {
    if (HitBlock(from, direction, cell[0], cell[1], &hit)) return hit;
    const int k = next[0] < next[1] ? 0 : 1;
    distance = next[k];
    cell[k] += direction[k] > 0.0 ? 1 : -1;
    next[k] += step[k];
  }
  return hit;
}

}  // namespace adasfm
