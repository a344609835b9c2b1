// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/sim3d.h"

namespace adasfm {

// A keypoint of one part of a drive that observes a point of the other part.
struct SightAcross {
  // Observations of one point err together.
  int point_id = 0;
  // Whether the point is one of part a, and the camera of part b.
  bool is_point_of_a = true;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // in its part's world
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // in the camera's part
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();    // unit, in the same
  // Largest angle between the ray and the point that counts as a fit.
  double max_angle_rad = 0.01;
};

// The similarity from part b to the world of part a.
struct PartJoin {
  Sim3d a_from_b;
  // 1 sigma of log(a_from_b.scale).
  double log_scale_sigma = 0.0;
  // Sights that fit, and their points.
  int num_sights = 0;
  int num_points = 0;
};

// Estimates place and scale of two parts, each adjusted by itself, from the
// points that both see. Image pairs constrain them less: before an adjustment
// neither their directions nor their depths are good enough where a camera
// rotates. sights: in either direction. a_from_b_rotation: right to a few
// degrees.
//
// Residuals are sines of the angles between rays and points. With the rotation
// held, two sights determine place and scale; the best of many such pairs is
// the start. Gauss-Newton refines all seven, robustly (Cauchy, at twice the
// median). Covariance: cluster-robust (sandwich) with points as clusters.
// Returns nothing without 15 points that fit, where most sights do not fit, or
// where twice or half the scale fits as well.
std::optional<PartJoin> EstimatePartJoin(
    const std::vector<SightAcross>& sights,
    const Eigen::Quaterniond& a_from_b_rotation);

}  // namespace adasfm
