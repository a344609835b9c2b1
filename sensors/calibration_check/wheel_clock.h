// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

// What: the seconds to add to the times of the wheels for the gyroscope's
// clock. Inputs: logs in order of time, speeds with yaw rates (ObservesYaw),
// the calibration for the wheels' vertical axis. Method: turns over windows of
// 0.2 s, the wheels' against the gyroscope's about the vertical axis with a
// free scale (the track width) and bias, at shifts of up to 0.15 s; the least
// mean distance wins. None unless it is a tenth less than without a shift, and
// makes the turns e^20 times likelier (as vision's shift,
// check_against_vision.h). On failure: none with too few windows or too little
// turning.
std::optional<double> FindWheelClockShift(const std::vector<ImuSample>& imu,
                                          const std::vector<WheelSpeed>& speeds,
                                          const SensorCalibration& calibration);

}  // namespace adasfm
