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

// Whether the focal lengths of an adjusted model are wrong, those of the
// problem's constant cameras taken for right, as vision and the priors together
// see it: at most 300 consecutive images, those that turn most, are adjusted
// with given and with free focal lengths, keypoints at their plain sigma. An
// error counts when it lowers the cost by 10 sigmas of the residuals as they
// are (3 where a focal length is not measured), is beyond what calibrations
// repeat to, and leaves priors that err no more than the balance allows: where
// they still do, keypoints share errors of other kinds, and free focal lengths
// would take those up. None without priors, or where these turn by less than 20
// deg in all. The model is left as it is.
std::optional<FocalLengthError> FindFocalLengthError(
    const VarianceComponentOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
