// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/random.h"
#include "core/rigid3d.h"
#include "core/so3.h"
#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// A feature is recognised between views that do not differ by more.
inline constexpr double kMaxViewAngle = DegToRad(35.0);

// Two images that may match, by index; the first is the earlier one.
struct PairCandidate {
  int first, second;
  // The streets that look alike, of an alias.
  int street1 = -1;
  int street2 = -1;
  // Where camera 2 seems to be: its pose relative to the landmarks that look
  // like those which camera 1 sees. The true one unless it is an alias.
  Rigid3d apparent_cam2_from_world;

  bool IsAlias() const { return street1 >= 0; }
};

// Each image of the first camera with the next ones.
std::vector<PairCandidate> FindSequentialPairs(const SyntheticWorld& world);

// The candidates of the first camera, then those of the second camera and
// across: (l, r) gives (l, r'), (l', r') too, and each image its neighbour in
// the frame. Unchanged without a second camera.
std::vector<PairCandidate> AddSecondCamera(
    const SyntheticWorld& world, std::vector<PairCandidate> candidates);

// Images that stand close together and look the same way on another visit:
// the nearest earlier ones of each image of the first camera.
std::vector<PairCandidate> FindRevisits(
    const SyntheticWorld& world, const std::vector<double>& arc_lengths_m);

// Images at corresponding places of streets that look alike. In a town of each
// pair of streets first a run of neighbouring images, and after all runs the
// rest; parallel streets and floors in random order, all along.
std::vector<PairCandidate> FindAliases(const StreetGrid& grid,
                                       const SyntheticWorld& world,
                                       Random* random);

}  // namespace adasfm
