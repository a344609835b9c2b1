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

// A town: a random walk long enough for the drive, which likes to come back to
// streets driven before. Parallel streets: up one, down the next, and so on. A
// car park: around one block, again and again.
Route BuildRoute(const SyntheticWorldOptions& options, Random* random);

// Along the streets, or back and forth in lanes along x with U-turns.
Path BuildPath(const SyntheticWorldOptions& options, const Route& route);

// A machine on a field instead of a car in streets.
bool IsOnLawn(const SyntheticWorldOptions& options);

// Whether the route passes by look-alike places again and again.
bool IsPeriodic(const SyntheticWorldOptions& options);

// Lanes that the images reach.
int NumLanes(const SyntheticWorldOptions& options);

// Length of the U-turn from one lane into the next, m.
double UTurnLength(const SyntheticWorldOptions& options);

// Height per way driven: the ramp of a car park.
double RoadSlope(const SyntheticWorldOptions& options);

}  // namespace adasfm
