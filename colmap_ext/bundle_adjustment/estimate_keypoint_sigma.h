// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>

#include "colmap_ext/host/colmap.h"
#include "core/types.h"

namespace adasfm {

// 1 sigma of a keypoint's position per axis, in px, from the residuals of an
// adjusted reconstruction. Of a point that n images see, the squared residuals
// over sigma^2 are chi-square with k = 2 n - 3 degrees of freedom; the median
// over the points of their sum / (k (1 - 2 / (9 k))^3), which is sigma^2 for
// every k, does not feel wrong matches. The poses, which were adjusted to the
// same residuals, are allowed for by the share of the degrees of freedom that
// they took. Errors that keypoints have in common (calibration, forward motion)
// leave no residuals: variance_components.h looks for those.
struct KeypointSigmas {
  // None with less than a hundred points of three images or more.
  std::optional<double> of_all_px;
  // Of each camera of several, from the points that no other camera observes: a
  // blurred lens has no part in the residuals of a sharp one. Cameras with less
  // than a hundred such points are missing.
  std::map<camera_t, double> of_cameras_px;
};

KeypointSigmas EstimateKeypointSigmas(
    const colmap::Reconstruction& reconstruction);

// The largest reprojection error of a right observation of an adjusted
// reconstruction: min_error_px, or four sigmas of its keypoints where that is
// more. A threshold below the noise takes right observations away, and what is
// left understates the noise.
double MaxReprojErrorPx(double min_error_px,
                        const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
