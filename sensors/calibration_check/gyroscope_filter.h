// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"

namespace adasfm {

// A first-order low-pass filter between the true and the logged angular rate.
// With the logged rate g (rad/s), the true one at the log's time t is
//
//     w(t) = g(t + delay) + lag g'(t + delay)
//
// For slow rotations the filter is a pure time shift (delay + lag). Faster
// rotations are logged weaker and with a smaller shift, so that no shift fits
// both.
struct GyroscopeFilter {
  double lag_s = 0.0;  // time constant; 0: none
  double delay_s = 0.0;
};

// Replaces the logged rates by the true ones. Derivatives are taken over 20 ms;
// beyond the log its first or last rate applies. Times and specific forces stay
// as they are.
void UndoGyroscopeFilter(const GyroscopeFilter& filter,
                         std::vector<ImuSample>* imu);

}  // namespace adasfm
