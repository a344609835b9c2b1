// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "synthetic/landmarks.h"
#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Matches the images: neighbours in the sequence, revisited places, aliased
// places, and images with nothing in common. arc_lengths_m: the distance driven
// at each image of the first camera. Returns the share of aliased pairs that
// was reached, that of the options or the largest possible one.
double MatchImages(const StreetGrid& grid, const LandmarkMap& map,
                   const std::vector<double>& arc_lengths_m,
                   SyntheticWorld* world);

}  // namespace adasfm
