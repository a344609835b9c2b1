// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/rigid3d.h"

namespace adasfm {

// Whether a motion agrees with what a prior's sensors observed: within four
// sigmas and the given tolerances, which stand for what the covariance does not
// know (calibration, the coarse model's own noise).
struct PriorSupportOptions {
  double rotation_tolerance_rad = 0.05;
  // Of the prior's length, and at least this many metres.
  double translation_tolerance_ratio = 0.2;
  double translation_tolerance_m = 0.1;
};
bool IsSupportedByPrior(const PriorSupportOptions& options,
                        const RelativePosePrior& prior,
                        const Rigid3d& cam2_from_cam1);

// Whether the model contradicts the prior by what no error of vision or of the
// calibration explains: two look-alike places that are folded together, or an
// image at a wrong place, tear the priors there. None where wheels slipped or
// the model lacks an image.
std::optional<bool> IsTorn(const RelativePosePrior& prior,
                           const colmap::Reconstruction& model);

}  // namespace adasfm
