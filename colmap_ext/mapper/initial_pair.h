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

struct InitialPairOptions {
  // Parallaxes to ask for, the first one that any pair reaches is taken. The
  // coarse poses tell the parallax of every match, so a drive straight ahead,
  // with little of it, begins with the best pair there is.
  std::vector<double> min_parallaxes_deg = {6.0, 3.0, 1.5, 0.75};
  // A pair needs this many matches with that parallax.
  int min_num_points = 30;
  // Of a match to its epipolar line under the poses.
  double max_epipolar_error_px = 4.0;
};

// The best pairs among the images of the scene that are not registered yet,
// best first, at most max_num_pairs. The relative pose is the coarse one or the
// pair's own two-view geometry with the coarse length, whichever explains more
// matches.
std::vector<InitialPair> FindInitialPairs(const InitialPairOptions& options,
                                          const MapperScene& scene,
                                          size_t max_num_pairs);

}  // namespace adasfm
