// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"

namespace adasfm {

// The white noise densities that a log itself shows, where the stated ones are
// too small.
//
// Inputs: samples in order of time, a rate (rad/s, m/s^2) a sample; the stated
// densities and random walks.
//
// Method. White noise adds the same to the spectrum at all frequencies, motion
// and vibration only add to it. Second differences of means over 1, 4 and 16
// samples give the density at three frequencies, in stretches of one second; a
// log's quieter quarter of them counts. The least of the three is the most that
// white noise can be, and at least as much as it is: a stated density below
// it by more than chance is raised to it. One above it is kept, since a log may
// be filtered, and its errors (scale, alignment, time stamps) be more than
// noise.
//
// A log of fewer than eight stretches changes nothing.
ImuNoise RaiseToLog(const std::vector<ImuSample>& samples,
                    const ImuNoise& stated);

}  // namespace adasfm
