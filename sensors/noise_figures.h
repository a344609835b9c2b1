// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "sensors/io/calibration.h"
#include "sensors/sensor_summary.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The noise that logs themselves show, where the stated figures are too small:
// densities of the IMU, sigma of a wheel's speed.
//
// Method. White noise adds the same to the spectrum at all frequencies, motion
// and vibration only add to it. Second differences of means over 1, 4 and 16
// samples give the density at three frequencies, in stretches of one second; a
// log's quieter quarter of them counts, without those that do not change at all
// (wheels at rest). The least of the three is the most that white noise can be,
// and at least as much as it is. A stated density of the IMU below it by more
// than chance is raised to it; the speed of wheels, which is uneven for more
// reasons, when it is less than a fifth of it. A figure that small is another
// sensor's or in another unit: it is said in `warnings`. One above is kept,
// since a log may be filtered, and its errors (scale, alignment, time stamps)
// be more than noise.
//
// What a gyroscope misses between its samples depends on the drive, not on the
// rate alone. Its rotations over a second are compared with those from every
// other sample: white noise changes them by its own density, motion by three
// times what the rate loses (at 96, 24 and 10 Hz 0.02, 0.3 and 2 of the noise
// on KITTI 07). A loss above the noise is added to it, and said.
//
// A log of fewer than eight stretches changes nothing.
void RaiseNoiseFigures(const MotionLogs& logs, SensorCalibration* calibration,
                       std::vector<std::string>* warnings);

// Moves the noise figures in use to what the smoother's residuals show, within
// limits and never below the stated ones: what wheels err by is more than the
// noise of their readings. wheel_persistence: OdometryFusionProblem's, of
// `fused` and then of the next problem. The wheels' factors are the summary's.
// Returns whether a figure moved enough to smooth again.
bool CorrectNoiseFigures(const SensorCalibration& stated,
                         const OdometryFusionResult& fused,
                         SensorCalibration* in_use, double* wheel_persistence,
                         SensorSummary* summary);

}  // namespace adasfm
