// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>

#include "core/types.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct RelativeTranslationOptions {
  bool enabled = true;
  // 1 sigma of the global rotations' errors between two images, which rotate
  // directions by this times depth over baseline.
  double rotation_sigma_deg = 0.05;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct RelativeTranslationReport {
  int num_refined = 0;
  int num_without_direction = 0;
};

// min_t sum rho(x'^T [t]x R x), |t| = 1, with R = R_j R_i^T of the global
// rotations, for every kept visual edge (step 2.5). The residuals are divided
// by their image Jacobian, so they are px on any camera. The sign puts points
// in front of both cameras. Sets the edge's rotation to the global one, its
// direction, and direction_sigma_rad (the larger axis) from the normal matrix.
// An edge with (nearly) no baseline does not constrain the direction and loses
// has_translation.
RelativeTranslationReport EstimateRelativeTranslations(
    const RelativeTranslationOptions& options,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const GlobalCorrespondences& correspondences, ViewGraph* graph);

}  // namespace adasfm
