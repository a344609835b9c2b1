// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "colmap_ext/host/host_mapper.h"
#include "colmap_ext/mapper/local_mapper_scene.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

struct RegisterImageOptions {
  // v_p: an image that sees fewer points is not tried.
  int min_num_visible_points = 10;
  // A point within this distance of its keypoint is an inlier of a pose.
  double max_reproj_error_px = 8.0;
  // Inliers over visible points; wrong matches can reach smaller ratios.
  double min_inlier_ratio = 0.25;
  // Whether the coarse poses give a second candidate.
  bool use_global_candidate = true;
};

enum class RegisteredBy { kNone, kP3p, kGlobalPose };

// Registers an image (paper, section on image registration): the candidates are
// COLMAP's P3P and P_gb; the pose that explains more of the visible points
// wins. kNone when neither explains enough: the image then stays unregistered.
RegisteredBy RegisterImage(const RegisterImageOptions& options,
                           image_t image_id, MapperScene* scene);

// P_gb: the coarse motion from the registered co-visible images k, and from
// those that priors tie to the image. Rotation: the L1 mean (Weiszfeld; Hartley
// et al. 2013) of R^_ki R_k. Position: the per-axis median of
//   C_k + s R_k^T R^_k (C^_i - C^_k),
// where s is the ratio of local to coarse lengths between these images. The
// paper takes the median of translations instead; centres do not depend on
// where the origin lies. None when no such image is registered.
std::optional<Rigid3d> ComputeGlobalCandidate(const MapperScene& scene,
                                              image_t image_id);

}  // namespace adasfm
