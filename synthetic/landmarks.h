// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Height above the road, about [m].
inline constexpr double kCameraHeight = 1.2;
// Share of the visible features that the detector finds in an image.
inline constexpr double kDetectionRate = 0.8;

struct Landmark {
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
  // Horizontal normal of the surface; zero for poles and the ground, which are
  // seen from all sides.
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  // A feature has a size: too far away it is too small to be found, too near
  // it is too large.
  double max_distance = 0.0;
  // Stronger features are kept where an image has too many.
  double strength = 0.0;
};

// All landmarks of the streets. Street i has the indices [street_begin[i],
// street_begin[i + 1]), in the same order in all streets that look alike.
struct LandmarkMap {
  std::vector<Landmark> landmarks;
  std::vector<int> street_begin;

  int StreetOf(int landmark) const;
};

LandmarkMap BuildLandmarks(const SyntheticWorldOptions& options,
                           const StreetGrid& grid);

// Fills the keypoints of all images with the visible landmarks, projected with
// noise: the max_num_keypoints[i] strongest ones of image i, in random order.
// rows: the poses of the first and the last row of all images, or none for a
// global shutter.
void ObserveLandmarks(const StreetGrid& grid, const LandmarkMap& map,
                      const std::vector<int>& max_num_keypoints,
                      const std::vector<ExposurePoses>& rows,
                      SyntheticWorld* world);

}  // namespace adasfm
