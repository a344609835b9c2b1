// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct RelativePoseRefinementOptions {
  bool enabled = true;
  int max_num_iterations = 8;
  // Matches beyond this many add nothing; an even subset is taken.
  int max_num_matches = 150;
  // Where the Cauchy loss takes over, px of epipolar distance.
  double loss_scale_px = 1.5;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

// A prediction of a pair's rotation, by odometry or global rotations.
struct RotationPrediction {
  Eigen::Quaterniond cam2_from_cam1 = Eigen::Quaterniond::Identity();
  // Of a rotation vector in camera 2's frame, rad^2.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

// Replaces the poses of verification (fit to few matches) by least-squares
// ones: every kept visual edge's rotation and direction minimise the
// first-order (Sampson) epipolar distances in px of its matches, robustly, and
// their sigmas follow from the normal matrix. An edge without a useful pose
// (fewer than 8 matches) keeps what it had. Sets has_baseline too
// (DetectBaseline).
//
// In nearly planar scenes the cost has a valley, or a second optimum, degrees
// away. There predictions (none, or one per edge where there is one) decide:
// they enter as a quadratic term, unless the matches contradict them clearly.
void RefineRelativePoses(
    const RelativePoseRefinementOptions& options,
    const GlobalCorrespondences& correspondences,
    const std::vector<std::optional<RotationPrediction>>& predictions,
    ViewGraph* graph);

}  // namespace adasfm
