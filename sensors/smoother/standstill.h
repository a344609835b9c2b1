// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"
#include "sensors/smoother/motion_logs.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Marks the links over which the machine stands still, and how still.
//
// Inputs: the states' times (ns, IMU clock, one more than links), the logs, the
// IMU's white noise densities (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)).
//
// Method. (1) A link is a candidate when, in the second around it, the wheels
// (if any) do not turn and the IMU shows noise only, as it does on a machine
// that glides straight ahead, too: without wheels no camera may have seen it
// move. (2) Links in a row are a
// run. In a run the mean rate is the same for all links, but for noise and what
// they scatter by (medians): the link that is furthest from the mean of the
// others is taken out for as long as it is further than kMaxDeviation sigmas.
// (3) What is left of a run moves slowly all the same (springs, an idling
// engine, people): the spectral density of its rates near frequency zero comes
// from means over blocks of samples, and what exceeds the gyroscope's white
// noise is the machine's own motion, standstill_rate_density of each link. So
// the information of a long standstill grows as the log shows, not as white
// noise would have it.
//
// Links without IMU are left as they are. A log that is too short marks
// nothing.
void MarkStandstills(const std::vector<timestamp_t>& times_ns,
                     const MotionLogs& logs, const ImuNoise& noise,
                     std::vector<OdometryLink>* links);

}  // namespace adasfm
