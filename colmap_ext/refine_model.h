// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "colmap_ext/balance_priors.h"
#include "colmap_ext/local_mapper_scene.h"
#include "core/types.h"

namespace adasfm {

struct RefineModelOptions {
  bool use_priors_in_adjustment = true;
  double filter_max_reproj_error_px = 4.0;
  double min_triangulation_angle_deg = 1.5;
  double keypoint_sigma_px = 1.0;
  // As in LocalMapperOptions.
  PriorBalanceOptions balance;
  // Intrinsics are adjusted here and nowhere else, so that all parts agree
  // about them.
  bool refine_focal_length = false;
  bool refine_principal_point = false;
  bool refine_extra_params = false;
  // Parts that were put together need a round with loose thresholds, in which
  // tracks of different parts find each other.
  bool join_parts = true;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct RefineModelSummary {
  int num_iterations = 0;
  // 1 sigma of keypoints that agrees with the priors (balance_priors.h).
  double keypoint_sigma_px = 0.0;
  // Squared whitened residual of the priors per degree of freedom at the end.
  double prior_chi2_per_dof = 0.0;
  // Images that the priors contradict and that were put back.
  int num_images_put_back = 0;
};

// Refines the whole model once: bundle adjustment with priors, joining of
// tracks, triangulation of what is still missing, filters. Images that hold on
// few points are tied by weak coarse motions. An image whose motion contradicts
// the priors on all sides is put back to where the coarse model has it, without
// its points, so that the result is not worse than the priors.
RefineModelSummary RefineModel(const RefineModelOptions& options,
                               MapperScene* scene);

// Registers the scene's images where the coarse model has them, without points.
void RegisterAtCoarsePoses(MapperScene* scene);

// Turns the world so that gravity, averaged over the images that know it,
// points along -z; the smallest such turn. False when no image knows it.
bool AlignToGravity(const SceneData& data,
                    colmap::Reconstruction* reconstruction);

}  // namespace adasfm
