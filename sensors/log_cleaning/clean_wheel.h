// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/log_cleaning/clean_imu.h"

namespace adasfm {

// Leaves bad samples out of a wheel log in order of time, of a type other than
// kOdometry: spikes (find_spikes.h); speeds that drop to zero in one step and
// come back in one, from a failed encoder or bus (wheels that slip or brake
// take longer); speeds that repeat in all digits for too long. Counters
// (CountsTicks) are cumulative, so that the next reading contains what one
// misses: only their clock and missing samples are checked. An error when more
// than half of the samples is bad, or the clock's unit is wrong.
StatusOr<CleanedLog<WheelSample>> CleanWheel(
    const std::vector<WheelSample>& samples, WheelType type,
    const LogOrigin& origin);

}  // namespace adasfm
