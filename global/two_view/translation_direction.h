// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "global/view_graph/epipolar.h"

namespace adasfm {

// Everything of one edge that does not change with t: the constraint of match k
// is normals[k] . t = 0, normals = R x1 x x2.
struct TranslationProblem {
  EdgeBearings bearings;
  Eigen::Matrix3d rotation;
  std::vector<Eigen::Vector3d> normals;
};

TranslationProblem BuildTranslationProblem(EdgeBearings bearings,
                                           const Eigen::Matrix3d& rotation);

struct DirectionSearch {
  // Also search from pairs of matches when there is a start.
  bool search = true;
  int max_num_iterations = 20;
  // Where the Cauchy loss takes over, px.
  double loss_scale_px = 1.0;
};

struct TranslationDirection {
  // Unit vector; zero when there is none.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double cost = 0.0;
};

// The t, |t| = 1, of least robust cost: IRLS with least eigenvectors, from the
// best direction implied by pairs of matches and from start (when not zero).
// The sign puts most points in front of both cameras.
TranslationDirection EstimateTranslationDirection(
    const DirectionSearch& options, const TranslationProblem& problem,
    const Eigen::Vector3d& start);

}  // namespace adasfm
