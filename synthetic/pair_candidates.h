// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/random.h"
#include "core/rigid3d.h"
#include "core/so3.h"
#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Largest angle between two views in which a feature is recognised.
inline constexpr double kMaxViewAngle = DegToRad(35.0);

// Two images that may match, by index; the first is the earlier one.
struct PairCandidate {
  int first, second;
  // Of an aliased pair: the streets that look alike.
  int street1 = -1;
  int street2 = -1;
  // The apparent pose of camera 2: relative to the landmarks of the street of
  // camera 1, which look like those that it sees. The true pose unless the pair
  // is aliased.
  Rigid3d apparent_cam2_from_world;

  bool IsAlias() const { return street1 >= 0; }
};

// Each image of the first camera with its successors.
std::vector<PairCandidate> FindSequentialPairs(const SyntheticWorld& world);

// The candidates of the first camera, then those with the second camera: (i, j)
// also gives (i, j') and (i', j'), and each frame gives (i, i'), where i' is
// the image of the second camera in the frame of i. Unchanged without a second
// camera.
std::vector<PairCandidate> AddSecondCamera(
    const SyntheticWorld& world, std::vector<PairCandidate> candidates);

// Revisits: each image of the first camera with the nearest earlier images that
// look the same way on another visit.
std::vector<PairCandidate> FindRevisits(
    const SyntheticWorld& world, const std::vector<double>& arc_lengths_m);

// Images at corresponding places of streets that look alike. In a town, first a
// run of neighbouring images for each pair of streets, then all other
// candidates; for parallel streets and floors, all candidates in random order.
std::vector<PairCandidate> FindAliases(const StreetGrid& grid,
                                       const SyntheticWorld& world,
                                       Random* random);

}  // namespace adasfm
