// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// The intervals in which the machine is parked: all of a standstill of more
// than a minute but its first and last 20 s, whose samples the biases need. In
// between they would add nothing: a gyroscope integrated for hours only drifts.
// The machine is at rest in each second, or in both seconds around it.
std::vector<std::pair<timestamp_t, timestamp_t>> FindParkedIntervals(
    const MotionLogs& logs, const ImuNoise& noise);

// Marks the links over which the machine is stationary, with the density of its
// residual rotation. times_ns: the states' times (IMU clock, one more than
// links); noise: the IMU's white noise densities (rad/s/sqrt(Hz),
// m/s^2/sqrt(Hz)).
//
// (1) A link is a candidate when, in the second around it, the wheels (if any)
// do not turn and the IMU shows noise only. A machine that glides straight
// ahead shows noise only, too: without wheels no camera may have seen it move.
// (2) Successive candidates form a run. All links of a run have the same mean
// rate, except for noise and their scatter (medians). As long as a link differs
// from the mean of the others by more than kMaxDeviation sigmas, the one that
// differs most is removed. (3) The remaining links still move slowly (springs,
// an idling engine, people). Means over blocks of samples give the spectral
// density of their rates near frequency zero. Its excess over the gyroscope's
// white noise is the machine's own motion, standstill_rate_density of each
// link. So the information of a long standstill grows as the log shows, not as
// for white noise.
//
// Links without IMU are left as they are, and so are parked ones. A log that is
// too short marks nothing.
void MarkStandstills(const std::vector<timestamp_t>& times_ns,
                     const MotionLogs& logs, const ImuNoise& noise,
                     std::vector<OdometryLink>* links);

}  // namespace adasfm
