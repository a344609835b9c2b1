// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "synthetic/drive.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// The logs begin this long after the epoch, so that the time stamps look like
// those of a real recording.
inline constexpr timestamp_t kWorldStartNs = 1600000000000000000;

// The logs run on the IMU's clock, from the start of the drive to end_s.
// Specific forces and rates are those of the drive plus bias and noise:
// the standard deviation of a sample is density / sqrt(dt), that of a bias
// step is walk * sqrt(dt).
void SimulateImu(const Drive& drive, double end_s, SyntheticWorld* world);

// Wheel speeds of a differential drive. Encoders at rest show exactly zero.
void SimulateWheels(const Drive& drive, double first_image_s, double end_s,
                    SyntheticWorld* world);

// Positions of a receiver at options.gnss_rate_hz, with noise and jumps.
void SimulateGnss(const Drive& drive, double end_s, SyntheticWorld* world);

}  // namespace adasfm
