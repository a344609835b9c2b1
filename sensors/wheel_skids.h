// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

// Removes samples with impossible motion of the wheels; returns the number of
// stretches removed. speeds: in order of time.
//
// Tyres transmit at most 12 m/s^2. Speed times yaw rate, the lateral
// acceleration, exceeds this limit where one wheel skids: the log turns by tens
// of degrees in a moment. A speed that changes faster (means over 0.1 s) and
// changes back within 10 s shows wheels that spin or lock in between. Without
// an IMU or a camera nothing else reveals skids. More than a fifth of the log
// is no skid but a wrong track or unit: the log stays as it is.
int LeaveOutSkids(std::vector<WheelSpeed>* speeds);

}  // namespace adasfm
