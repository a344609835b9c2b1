// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "core/random.h"
#include "synthetic/path.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

inline constexpr double kBlockSize = 60.0;  // between street axes, m

using GridNode = std::array<int, 2>;

// Crossings in the order in which the car passes them; none on a lawn.
struct Route {
  std::vector<GridNode> nodes;
};

// A town: a random walk long enough for the drive that prefers streets driven
// before. Parallel streets: up one, down the next, and so on. A car park:
// around one block repeatedly.
Route BuildRoute(const SyntheticWorldOptions& options, Random* random);

// The path along the streets, or back and forth in lanes along x with U-turns.
Path BuildPath(const SyntheticWorldOptions& options, const Route& route);

// A machine on a field instead of a car in streets.
bool IsOnLawn(const SyntheticWorldOptions& options);

// Whether the route passes places that look alike periodically.
bool IsPeriodic(const SyntheticWorldOptions& options);

// The number of lanes that the images reach.
int NumLanes(const SyntheticWorldOptions& options);

// Length of the U-turn from one lane into the next, m.
double UTurnLength(const SyntheticWorldOptions& options);

// Height per distance driven on the ramp of a car park; 0 elsewhere.
double RoadSlope(const SyntheticWorldOptions& options);

}  // namespace adasfm
