// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>

#include "colmap_ext/mapper/local_mapper.h"
#include "colmap_ext/mapper/local_mapper_scene.h"
#include "core/types.h"

namespace adasfm {

struct RefineModelOptions {
  // Intrinsics are adjusted here and nowhere else, so that all parts agree
  // about them.
  bool refine_focal_length = false;
  bool refine_principal_point = false;
  bool refine_extra_params = false;
  // Cameras whose intrinsics stay constant nevertheless.
  std::set<camera_t> constant_cameras;
  // Merged parts need a round with loose thresholds, which joins tracks of
  // different parts.
  bool join_parts = true;
  // Scale of the robust loss on positions in the rounds before the last, in
  // sigmas: larger for a deformed coarse model.
  double initial_position_loss_scale =
      PriorBundleAdjustmentOptions().position_loss_scale;
  int num_threads = -1;
  // Memory bound of the process in GB; see PriorBundleAdjustmentOptions.
  double max_memory_gb = -1.0;
};

struct RefineModelSummary {
  int num_iterations = 0;
  // The largest value of an adjustment (PriorBundleAdjustmentSummary).
  int min_num_shared_points = 1;
  // Factor of the keypoints' sigma in balance with the priors. The first rounds
  // begin with that of the parts, the last one with 1.
  double keypoint_sigma_factor = 1.0;
  // 1 sigma of keypoints that agrees with the priors (variance_components.h).
  double keypoint_sigma_px = 0.0;
  // Sigmas of single cameras over keypoint_sigma_px.
  std::map<camera_t, double> keypoint_sigma_ratios;
  // Squared whitened residual of the priors per degree of freedom at the end.
  double prior_chi2_per_dof = 0.0;
  // Relative 1 sigma of the accelerometer's metre in the last adjustment; 0
  // without an accelerometer.
  double unit_sigma = 0.0;
  // Images that were reset to the coarse pose, as the priors contradict them.
  int num_images_reset = 0;
  // Images that were deregistered: too few points for a pose and no known
  // motions to other images, or in an untied part (FindUntiedParts).
  int num_images_deregistered = 0;
};

inline constexpr int kNumRefinementRounds = 3;
// Whether a round completes tracks; the first only adjusts.
inline bool NeedsMatches(int refinement_round) { return refinement_round > 1; }

// Refines the whole model with the thresholds, the noise of keypoints and the
// balance of local mapping. Call it for the rounds 1 to kNumRefinementRounds
// with the same summary; between them the model can be saved. Rounds join
// tracks, triangulate missing points, filter, and adjust with priors. Weak
// coarse motions constrain images with few points. An image that violates all
// its priors is reset to its coarse pose, without its points, so that the
// result is not worse than the priors. In the last round images that neither
// points nor priors constrain are deregistered. A round that needs the scene's
// matches releases them.
void RefineModel(const RefineModelOptions& options,
                 const LocalMapperOptions& local, int round, MapperScene* scene,
                 RefineModelSummary* summary);

// Registers the scene's images at their coarse poses, without points.
void RegisterAtCoarsePoses(MapperScene* scene);

}  // namespace adasfm
