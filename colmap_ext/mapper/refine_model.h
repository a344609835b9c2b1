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
  // Cameras whose intrinsics stay all the same.
  std::set<camera_t> constant_cameras;
  // Parts that were put together need a round with loose thresholds, in which
  // tracks of different parts find each other.
  bool join_parts = true;
  // Where the robust loss on positions takes over in the rounds before the
  // last, in sigmas: as far as the coarse model is bent.
  double initial_position_loss_scale =
      PriorBundleAdjustmentOptions().position_loss_scale;
  int num_threads = -1;
  // Of the process, in GB (1e9 bytes); see PriorBundleAdjustmentOptions.
  double max_memory_gb = -1.0;
};

struct RefineModelSummary {
  int num_iterations = 0;
  // The most that an adjustment asked for (PriorBundleAdjustmentSummary).
  int min_num_shared_points = 1;
  // By which the keypoints' sigma is multiplied in balance with the priors.
  // The first rounds begin with what the parts had, the last one with 1.
  double keypoint_sigma_factor = 1.0;
  // 1 sigma of keypoints that agrees with the priors (variance_components.h).
  double keypoint_sigma_px = 0.0;
  // Of single cameras, over keypoint_sigma_px.
  std::map<camera_t, double> keypoint_sigma_ratios;
  // Squared whitened residual of the priors per degree of freedom at the end.
  double prior_chi2_per_dof = 0.0;
  // 1 sigma of the accelerometer's metre in the last adjustment, as a ratio; 0
  // without.
  double unit_sigma = 0.0;
  // Images that the priors contradict and that were put back.
  int num_images_put_back = 0;
  // Images that end with too few points for a pose and that no known motions
  // tie to others.
  int num_images_left_out = 0;
};

inline constexpr int kNumRefinementRounds = 3;
// Whether a round completes tracks; the first only adjusts.
inline bool NeedsMatches(int refinement_round) { return refinement_round > 1; }

// Refines the whole model by the thresholds, the noise of keypoints and the
// balance that local mapping had, in rounds from 1 to kNumRefinementRounds that
// follow each other on the same summary; between them the model can be saved.
// Joining of tracks, triangulation of what is still missing, filters, and
// bundle adjustments with priors. Images that hold on few points are tied by
// weak coarse motions. An image whose motion contradicts the priors on all
// sides is put back to where the coarse model has it, without its points, so
// that the result is not worse than the priors. An image that neither points
// nor priors hold is left out in the end. A round that needs the scene's
// matches releases them.
void RefineModel(const RefineModelOptions& options,
                 const LocalMapperOptions& local, int round, MapperScene* scene,
                 RefineModelSummary* summary);

// Registers the scene's images where the coarse model has them, without points.
void RegisterAtCoarsePoses(MapperScene* scene);

}  // namespace adasfm
