// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/status.h"

namespace adasfm {

// Takes from the recording (paths->data_format) what the user did not give,
// writing the calibration and times that it has in other forms into the
// workspace, and settles the options that follow from the input: threads for
// all stages, and the refinement of intrinsics that nobody has calibrated.
Status PrepareReconstruction(AutomaticReconstructionOptions* options,
                             AutomaticReconstructionPaths* paths);

}  // namespace adasfm
