// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/log_cleaning/clean_imu.h"

namespace adasfm {

// What: leaves bad samples out of a wheel log.
// Inputs: samples in order of time, their type (not kOdometry), and where they
// come from.
// Method: spikes (find_spikes.h); speeds that drop to zero, or begin to repeat
// themselves in all digits, in one step and come back in one: an encoder or a
// bus that failed. Wheels that slip or brake take longer. Counters (kTicks) are
// cumulative: what a reading misses, the next one has; only their clock and
// missing samples are looked at.
// On failure: as CleanImu.
StatusOr<CleanedLog<WheelSample>> CleanWheel(
    const std::vector<WheelSample>& samples, WheelType type,
    const LogOrigin& origin);

}  // namespace adasfm
