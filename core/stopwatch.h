// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

namespace adasfm {

// Measures the time since construction.
class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

}  // namespace adasfm
