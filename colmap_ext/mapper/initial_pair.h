// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/mapper/local_mapper_scene.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// Two images to begin with and their poses in the coarse frame.
struct InitialPair {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  Rigid3d cam1_from_world;
  Rigid3d cam2_from_world;
  // Matches that the poses explain with at least the parallax asked for.
  int num_points = 0;
};

// A pair needs this many matches with the parallax asked for.
inline constexpr int kMinNumInitialMatches = 30;

// The best pairs among the images of the scene that are not registered yet,
// best first, at most max_num_pairs. The relative pose is the coarse one or the
// pair's own two-view geometry with the coarse length, whichever explains more
// matches, within max_epipolar_error_px of their epipolar lines.
std::vector<InitialPair> FindInitialPairs(double max_epipolar_error_px,
                                          const MapperScene& scene,
                                          size_t max_num_pairs);

}  // namespace adasfm
