// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "colmap_ext/host/colmap.h"

namespace adasfm {

struct FocalLengthError {
  // The camera whose ratio is farthest from 1.
  camera_t camera_id = 0;
  // Its new focal length over the old one.
  double ratio = 1.0;
  // 1 sigma of the ratio, by the change of the cost, and at least 0.1 %.
  double sigma = 0.0;
};

// Tests whether the focal lengths of an adjusted model contradict vision and
// the priors together; those of the problem's constant cameras are taken as
// correct. At most 300 consecutive images, those with most rotation, are
// adjusted with given and with free focal lengths, at the plain keypoint sigma.
// An error counts when it lowers the cost by 10 sigmas of the present residuals
// (3 where a focal length is not measured), exceeds the repeatability of
// calibrations, and leaves the priors within the limit of the balance. Beyond
// that limit keypoints share errors of other kinds, which free focal lengths
// would absorb. None without priors, or where they never rotate by 20 deg from
// the first orientation. The model is unchanged.
std::optional<FocalLengthError> FindFocalLengthError(
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
