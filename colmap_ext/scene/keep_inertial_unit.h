// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/relative_pose_prior.h"

namespace adasfm {

// Restores the metres of an adjusted model whose coarse model has its unit from
// the accelerometer (colmap_ext/coarse/measure_size.h). Adjustments fix the
// scale of such a model like that of a model without metres, so that the scale
// may have changed with the shape. Scales the model by the median, weighted by
// length, of the ratios of the stated lengths (kPriorInertialLength) to the
// model's lengths. Without such lengths between its images the model stays as
// it is.
void KeepInertialUnit(const std::vector<RelativePosePrior>& priors,
                      colmap::Reconstruction* reconstruction);

}  // namespace adasfm
