// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/io/calibration.h"

namespace adasfm {

// What: tells a clock that jumped from one that is off by a constant.
// Inputs: as CheckAgainstVision, which found a time shift.
// Method: the log is cut at its longest gap (of more than three periods), and
// both parts are compared with vision. Shifts that differ by more than
// max_accepted_shift_s are a jump.
// On failure: an empty line when there is no gap, or a part tells nothing.
std::string FindClockJump(const std::vector<TimedRotation>& rotations,
                          const std::vector<ImuSample>& imu,
                          const SensorCalibration& calibration,
                          const VisionCheckOptions& options);

}  // namespace adasfm
