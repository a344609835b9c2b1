// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/status.h"

namespace adasfm {

// Takes what the user did not give from the recording (paths->data_format);
// writes its calibration and times, where they have other forms, into the
// workspace. Sets the options that follow from the input: threads for all
// stages, and the refinement of uncalibrated intrinsics.
Status PrepareReconstruction(AutomaticReconstructionOptions* options,
                             AutomaticReconstructionPaths* paths);

}  // namespace adasfm
