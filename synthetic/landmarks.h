// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

struct Landmark {
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
  // The way the surface faces; zero for poles and the ground, which are seen
  // from all sides.
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  // A feature has a size: too far away it is too small to be found, too near
  // it is too large.
  double max_distance = 0.0;
  // Stronger features win where an image has more than it may keep.
  double strength = 0.0;
  // The landmark that looks the same in the twin street, or -1.
  int twin = -1;
};

// All landmarks of the streets; those of street i are the indices
// [street_begin[i], street_begin[i + 1]).
struct LandmarkMap {
  std::vector<Landmark> landmarks;
  std::vector<int> street_begin;
};

LandmarkMap BuildLandmarks(const SyntheticWorldOptions& options,
                           const StreetGrid& grid);

// Fills the keypoints of all images from their poses: what the camera sees,
// neither hidden nor too far, the strongest first, with noise. Blacked-out
// images stay empty.
void ObserveLandmarks(const StreetGrid& grid, const LandmarkMap& map,
                      const std::vector<bool>& is_blacked_out,
                      SyntheticWorld* world);

}  // namespace adasfm
