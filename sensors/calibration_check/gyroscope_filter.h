// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/sensor_log.h"

namespace adasfm {

// A first-order low-pass filter between what turned and what was logged. With
// the logged rate g (rad/s), the true one at the log's time t is
//
//     w(t) = g(t + delay) + lag g'(t + delay)
//
// A pure time shift is what remains of it for slow turns (delay + lag); faster
// ones are logged weaker and earlier than that, so that no shift fits both.
struct GyroscopeFilter {
  double lag_s = 0.0;  // its time constant; 0: none
  double delay_s = 0.0;
};

// Turns the logged rates into the true ones. Derivatives are taken over 20 ms;
// the log's first and last rate stand for what lies beyond it. Times and
// specific forces stay as they are.
void UndoGyroscopeFilter(const GyroscopeFilter& filter,
                         std::vector<ImuSample>* imu);

}  // namespace adasfm
