// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/sim3d.h"

namespace adasfm {

// A keypoint of one part of a drive that sees a point of the other one.
struct SightAcross {
  // Observations of one point err together.
  int point_id = 0;
  // Whether the point is one of part a, and the camera of part b.
  bool is_point_of_a = true;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // in its part's world
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // in the camera's part
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();    // unit, in the same
  // A point off the ray by more does not fit.
  double max_angle_rad = 0.01;
};

// How part b lies in the world of part a.
struct PartJoin {
  Sim3d a_from_b;
  // 1 sigma of log(a_from_b.scale).
  double log_scale_sigma = 0.0;
  // Sights that fit, and their points.
  int num_sights = 0;
  int num_points = 0;
};

// What: place and size of two parts, each adjusted by itself, by the points
// that both see. Pairs of images tell less: before an adjustment neither their
// directions nor their depths are good enough where a camera turns.
// Inputs: sights in either direction; the rotation a_from_b to a few degrees.
// Method. Sines of the angles between rays and points. With the rotation held,
// two sights tell place and size; of many such pairs the best begins. Then all
// seven by Gauss-Newton, robust (Cauchy, at twice the median). The covariance
// is the sandwich over points.
// Returns nothing without 15 points that fit, where most sights do not, or
// where the iterations diverge, as they do when no sight tells the size.
std::optional<PartJoin> EstimatePartJoin(
    const std::vector<SightAcross>& sights,
    const Eigen::Quaterniond& a_from_b_rotation);

}  // namespace adasfm
