// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/gyroscope_filter.h"

#include <algorithm>
#include <cmath>

namespace adasfm {

void UndoGyroscopeFilter(const GyroscopeFilter& filter,
                         std::vector<ImuSample>* imu) {
  if (imu->size() < 2) return;
  constexpr timestamp_t kStepNs = 10'000'000;
  const timestamp_t delay_ns = NsFromSeconds(filter.delay_s);
  const std::vector<ImuSample> logged = *imu;
  size_t next = 1;
  // The queried times ascend, except for the steps to both sides.
  const auto rate_at = [&](timestamp_t time_ns) -> Eigen::Vector3d {
    while (next + 1 < logged.size() && logged[next].timestamp_ns < time_ns) {
      ++next;
    }
    while (next > 1 && logged[next - 1].timestamp_ns > time_ns) --next;
    const ImuSample& a = logged[next - 1];
    const ImuSample& b = logged[next];
    const double ratio = std::min(
        1.0, std::max(0.0, SecondsFromNs(time_ns - a.timestamp_ns) /
                               SecondsFromNs(b.timestamp_ns - a.timestamp_ns)));
    return (1.0 - ratio) * a.angular_velocity + ratio * b.angular_velocity;
  };
  for (ImuSample& sample : *imu) {
    const timestamp_t time = sample.timestamp_ns + delay_ns;
    const Eigen::Vector3d derivative =
        (rate_at(time + kStepNs) - rate_at(time - kStepNs)) /
        SecondsFromNs(2 * kStepNs);
    sample.angular_velocity = rate_at(time) + filter.lag_s * derivative;
  }
}

}  // namespace adasfm
