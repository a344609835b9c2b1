// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>

#include "colmap_ext/host/colmap.h"
#include "core/types.h"

namespace adasfm {

// 1 sigma of a keypoint's position per axis, in px, from the residuals of an
// adjusted reconstruction. For a point that n images see, the sum of the
// squared residuals over sigma^2 is chi-square with k = 2 n - 3 degrees of
// freedom. The median over the points of sum / (k (1 - 2 / (9 k))^3) is sigma^2
// for every k, and robust against wrong matches. It is corrected for the share
// of the degrees of freedom that the poses took, which were adjusted to the
// same residuals. Errors that keypoints share (calibration, forward motion)
// leave no residuals; variance_components.h estimates those.
struct KeypointSigmas {
  // None with fewer than a hundred points of three images or more, or where the
  // poses took half of the degrees of freedom.
  std::optional<double> of_all_px;
  // For each camera of several, from the points that no other camera observes,
  // so that a blurred lens does not affect a sharp one. Cameras with fewer than
  // a hundred such points are missing.
  std::map<camera_t, double> of_cameras_px;
};

KeypointSigmas EstimateKeypointSigmas(
    const colmap::Reconstruction& reconstruction);

// The largest reprojection error of a correct observation of an adjusted
// reconstruction: min_error_px, or four sigmas of its keypoints where that is
// more. A threshold below the noise would remove correct observations, and the
// remaining ones would understate the noise.
double MaxReprojErrorPx(double min_error_px,
                        const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
