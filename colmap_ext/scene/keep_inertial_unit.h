// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/relative_pose_prior.h"

namespace adasfm {

// Gives an adjusted model back the metres that the accelerometer told its
// coarse model (colmap_ext/coarse/measure_size.h). Adjustments hold such a
// model's scale as they hold that of one without metres, so that it may have
// changed with the shape: the model is scaled by the median, by length, of the
// ratio of the stated lengths (kPriorInertialLength) to its own. Without such
// lengths between its images the model stays as it is.
void KeepInertialUnit(const std::vector<RelativePosePrior>& priors,
                      colmap::Reconstruction* reconstruction);

}  // namespace adasfm
