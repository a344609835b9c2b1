// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/rigid3d.h"

namespace adasfm {

// Whether a motion agrees with what a prior's sensors observed: within four
// sigmas and tolerances for errors that the covariance does not include
// (calibration, the coarse model's own noise): 0.05 rad; 20 % of the length and
// at least 0.1 m.
bool IsSupportedByPrior(const RelativePosePrior& prior,
                        const Rigid3d& cam2_from_cam1);

// Whether the model violates the prior by more than any error of vision or of
// the calibration explains, as where perceptual aliasing folds two places
// together or an image has a wrong pose. None where wheels slipped, the model
// lacks an image, or the prior has neither a rotation nor a length.
std::optional<bool> IsViolated(const RelativePosePrior& prior,
                               const colmap::Reconstruction& model);

}  // namespace adasfm
