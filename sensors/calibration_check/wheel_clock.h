// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/io/calibration.h"
#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

// Finds the seconds to add to the times of the wheels for the gyroscope's
// clock. Inputs: logs in order of time, speeds with yaw rates (ObservesYaw),
// the calibration for the wheels' vertical axis. Rotations of wheels and
// gyroscope about this axis over windows of 0.2 s are compared with a free
// scale (the track width) and bias, at shifts of up to 0.15 s; the least mean
// distance wins. None unless this distance is a tenth less than without a shift
// and makes the rotations e^20 times likelier (as for vision's shift,
// check_against_vision.h). None with too few windows or too little rotation.
std::optional<double> FindWheelClockShift(const std::vector<ImuSample>& imu,
                                          const std::vector<WheelSpeed>& speeds,
                                          const SensorCalibration& calibration);

}  // namespace adasfm
