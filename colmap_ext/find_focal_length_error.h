// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/reconstruction.h>

#include <optional>

#include "colmap_ext/balance_priors.h"
#include "colmap_ext/bundle_adjustment.h"

namespace adasfm {

// Whether wrong focal lengths are why vision and the priors of an adjusted
// model contradict each other: the model is adjusted once more with free focal
// lengths and with keypoints at their plain sigma. When the priors then err no
// more than the balance allows, the ratio of the new focal length to the old
// one is returned (that of the camera that is farthest from 1); none when they
// still do, or when it changes by less than calibrations repeat. The model is
// left as it is.
std::optional<double> FindFocalLengthError(
    const PriorBalanceOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
