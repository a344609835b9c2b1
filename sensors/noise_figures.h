// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "sensors/io/calibration.h"
#include "sensors/sensor_summary.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Raises stated noise figures to the noise that the logs show: noise densities
// of the IMU, sigma of a wheel's speed.
//
// White noise has the same density at all frequencies; motion and vibration
// only add to the spectrum. Second differences of means over 1, 4 and 16
// samples give the density at three frequencies, in stretches of one second.
// The quieter quarter of a log's stretches counts, without stretches that do
// not change at all (wheels at rest). The smallest of the three densities is an
// upper bound of the white noise. A stated IMU density that is smaller by more
// than chance is raised to this bound. The speed of wheels is uneven for other
// reasons too; its noise is raised when it is less than a fifth of the bound. A
// stated figure below a fifth belongs to another sensor or has another unit,
// which is added to `warnings`. A figure above the bound is kept, since a log
// may be filtered and its errors (scale, alignment, time stamps) may exceed its
// noise.
//
// What a gyroscope misses between its samples depends on the drive, not on the
// rate alone. Its rotations over a second are compared with those from every
// other sample. White noise changes them by its own density, motion by three
// times the loss at the full rate (at 96, 24 and 10 Hz 0.02, 0.3 and 2 of the
// noise on KITTI 07). A loss above the noise is added to the noise, with a
// warning.
//
// A log of fewer than eight stretches changes nothing.
void RaiseNoiseFigures(const MotionLogs& logs, SensorCalibration* calibration,
                       std::vector<std::string>* warnings);

// Adapts the noise figures in use to the smoother's residuals, within limits
// and never below the stated figures, since errors of wheels exceed the noise
// of their readings. wheel_persistence: OdometryFusionProblem's, in the problem
// of `fused` on entry and for the next problem on return. The factors of the
// wheels' noise are kept in the summary. Returns whether a figure changed
// enough to smooth again.
bool CorrectNoiseFigures(const SensorCalibration& stated,
                         const OdometryFusionResult& fused,
                         SensorCalibration* in_use, double* wheel_persistence,
                         SensorSummary* summary);

}  // namespace adasfm
