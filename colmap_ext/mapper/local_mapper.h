// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/mapper/initial_pair.h"
#include "colmap_ext/mapper/local_mapper_scene.h"
#include "colmap_ext/mapper/register_image.h"

namespace adasfm {

struct LocalMapperOptions {
  // Largest distance of an initial pair's match to its epipolar line.
  double initial_max_epipolar_error_px = 4.0;
  RegisterImageOptions registration;
  // Whether sensor priors take part in the adjustments.
  bool use_priors_in_adjustment = true;
  // The coarse motion of every pair of the augmented view graph as a term of a
  // part's adjustments (paper, eq. 8). Off: the coarse model came from the same
  // matches, which would count twice (docs/reference/mapper.md has figures).
  bool use_coarse_motions_in_parts = false;
  // Tracks are completed and joined within this error. After an adjustment,
  // observations beyond it (or beyond MaxReprojErrorPx, where the noise asks
  // for more) and points below min_triangulation_angle_deg are removed. Joining
  // does not adapt to the noise, as it would join neighbouring points.
  double filter_max_reproj_error_px = 4.0;
  double min_triangulation_angle_deg = 1.5;
  // 1 sigma of a keypoint's position, which weighs priors against keypoints.
  double keypoint_sigma_px = 0.5;
  // How vision is weighed against the priors.
  VarianceComponentOptions balance;
  int num_threads = 1;

  bool IsValid(std::string* error) const;
};

struct LocalMapResult {
  // Only registered images; in the coarse frame up to drift.
  colmap::Reconstruction reconstruction;
  // Registered images whose pose rests on priors alone.
  std::set<image_t> prior_only_images;
  int num_registered_by_global_pose = 0;
  int num_global_adjustments = 0;
  double mean_reproj_error_px = 0.0;
  // Factor of keypoint_sigma_px in balance with the priors.
  double keypoint_sigma_factor = 1.0;
};

// Reconstructs one part incrementally, steered by the coarse poses (paper,
// section on local incremental SfM):
//   1. initial pair, in the coarse frame
//   2. batches of all images that see v_p points, best first, each with the
//      better one of its two candidate poses
//   3. bundle adjustment with priors: the batch after each batch, the part when
//      it has grown
//   4. again from 1 for images that the matches did not reach: coarse poses
//      connect the pieces
//   5. images that no points reach take the coarse pose where priors confirm it
//   6. retriangulation and a final adjustment.
// Images without any support stay unregistered. Throws std::runtime_error when
// no initial pair is found.
LocalMapResult ReconstructLocally(const LocalMapperOptions& options,
                                  const SceneData& data,
                                  const CoarsePoseMap& coarse,
                                  const std::set<image_t>& images);

}  // namespace adasfm
