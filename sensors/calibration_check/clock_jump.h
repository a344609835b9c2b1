// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/io/calibration.h"

namespace adasfm {

// Distinguishes a clock that jumped from a clock with a constant offset. Inputs
// as for CheckAgainstVision, which found a time shift. The log is cut at its
// longest gap (of more than three periods), and both parts are compared with
// vision. Shifts that differ by more than kMaxAcceptedShiftS are a jump.
// Returns one line about the jump; empty without a jump or a gap, or when a
// part is not conclusive.
std::string FindClockJump(const std::vector<TimedRotation>& rotations,
                          const std::vector<ImuSample>& imu,
                          const SensorCalibration& calibration);

}  // namespace adasfm
