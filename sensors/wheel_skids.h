// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

// What: leaves out where wheels move as no machine can.
// Inputs: speeds in order of time; returns the number of stretches left out.
// Method: no tyre holds more than 12 m/s^2. Speed times yaw rate, the sideways
// acceleration, is beyond it where one wheel skids: its log turns by tens of
// degrees in a blink. A speed that changes faster (means over 0.1 s) and within
// 10 s back again is that of wheels that spin or lock in between. Without an
// IMU or a camera nothing else tells. More than a fifth of the log is no skid
// but a wrong track or unit, and left as it is.
int LeaveOutSkids(std::vector<WheelSpeed>* speeds);

}  // namespace adasfm
