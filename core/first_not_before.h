// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "core/types.h"

namespace adasfm {

// The first sample at time_ns or later, of samples sorted by timestamp_ns;
// their end when there is none.
template <typename Sample>
typename std::vector<Sample>::const_iterator FirstNotBefore(
    const std::vector<Sample>& samples, timestamp_t time_ns) {
  return std::lower_bound(samples.begin(), samples.end(), time_ns,
                          [](const Sample& sample, timestamp_t time) {
                            return sample.timestamp_ns < time;
                          });
}

}  // namespace adasfm
