// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/calibration_check/shift_search.h"

namespace adasfm {

// What: how much of the cameras' turning the gyroscope cannot explain, whatever
// the clock and the mounting. A camera that stabilises its video turns its
// pictures: they keep the slow turns of the machine, and lose the fast ones.
// Inputs: two-view rotations on the camera's clock, with the search that holds
// the gyroscope's log.
// Method: over the shortest intervals the turning rates about their median are
// compared at every time shift within 0.3 s and at `shift_s`, the best one for
// the mounting as calibrated, each with the mounting that suits it best (the
// rotation between two sets of vectors, Kabsch 1976, with weights that bound
// the pull of wrong two-view geometries). What vision errs by itself is seen
// where three images close a triangle. What this and the gyroscope's noise
// (rad/s/sqrt(Hz)) leave is put down to the times of the images. On failure:
// not conclusive with too few intervals or triangles.
UnexplainedRotation FindUnexplainedRotation(
    const std::vector<TimedRotation>& rotations, const ShiftSearch& search,
    double shift_s, double gyroscope_noise_density,
    const VisionCheckOptions& options);

}  // namespace adasfm
