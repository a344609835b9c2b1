// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/calibration_check/shift_search.h"

namespace adasfm {

// Measures how much of the cameras' rotation the gyroscope cannot explain,
// whatever the time shift and the extrinsic rotation. A camera that stabilises
// its video rotates its pictures: they keep the slow rotations of the machine
// and lose the fast ones. Inputs: two-view rotations on the camera's clock, and
// the search over the gyroscope's log.
//
// Over the shortest intervals the angular rates about their median are compared
// at every time shift within 0.3 s and at `shift_s`, the best one for the
// rotation as calibrated. Each shift gets its best-fitting rotation (between
// two sets of vectors, Kabsch 1976, with weights that bound the influence of
// wrong two-view geometries). The error of vision itself comes from triangles
// of three images. The residual beyond this error and the gyroscope's noise
// (rad/s/sqrt(Hz)) is attributed to the times of the images. Not conclusive
// with too few intervals or triangles.
UnexplainedRotation FindUnexplainedRotation(
    const std::vector<TimedRotation>& rotations, const ShiftSearch& search,
    double shift_s, double gyroscope_noise_density);

}  // namespace adasfm
