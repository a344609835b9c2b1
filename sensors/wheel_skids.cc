// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/wheel_skids.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/types.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

constexpr double kMaxAcceleration = 12.0;  // m/s^2
constexpr double kWindowS = 0.2;
constexpr double kMaxSkidS = 10.0;
constexpr double kMaxSkidRatio = 0.2;

void Mark(size_t begin, size_t end, std::vector<bool>* skids) {
  std::fill(skids->begin() + begin, skids->begin() + end, true);
}

// Windows whose mean sideways acceleration is impossible.
void MarkTurns(const std::vector<WheelSpeed>& speeds,
               std::vector<bool>* skids) {
  const timestamp_t window_ns = NsFromSeconds(kWindowS);
  double speed = 0.0, yaw_rate = 0.0;
  size_t begin = 0;
  for (size_t end = 0; end < speeds.size(); ++end) {
    speed += speeds[end].speed;
    yaw_rate += speeds[end].yaw_rate;
    while (speeds[end].timestamp_ns - speeds[begin].timestamp_ns > window_ns) {
      speed -= speeds[begin].speed;
      yaw_rate -= speeds[begin].yaw_rate;
      ++begin;
    }
    const double size = end - begin + 1.0;
    if (std::abs(speed * yaw_rate) > kMaxAcceleration * size * size) {
      Mark(begin, end + 1, skids);
    }
  }
}

// At each sample: the mean speed over half a window from there on, minus that
// over the half before.
std::vector<double> SpeedChanges(const std::vector<WheelSpeed>& speeds,
                                 size_t half) {
  std::vector<double> sums = {0.0};
  for (const WheelSpeed& speed : speeds) {
    sums.push_back(sums.back() + speed.speed);
  }
  std::vector<double> changes(speeds.size(), 0.0);
  for (size_t i = half; i + half <= speeds.size(); ++i) {
    changes[i] = (sums[i + half] - 2.0 * sums[i] + sums[i - half]) / half;
  }
  return changes;
}

// Marks what lies between impossible speed changes of opposite sign.
void MarkJumps(const std::vector<WheelSpeed>& speeds,
               std::vector<bool>* skids) {
  std::vector<timestamp_t> times_ns;
  for (const WheelSpeed& speed : speeds) times_ns.push_back(speed.timestamp_ns);
  const double period_s = ComputeMedianPeriod(times_ns);
  if (period_s <= 0.0 || period_s > kWindowS / 2.0) return;
  const size_t half = std::lround(kWindowS / 2.0 / period_s);
  const std::vector<double> changes = SpeedChanges(speeds, half);
  const double limit = kMaxAcceleration * half * period_s;
  std::vector<size_t> jumps;
  size_t last = 0;
  for (size_t i = 0; i < changes.size(); ++i) {
    if (std::abs(changes[i]) <= limit) continue;
    // A jump takes several samples, of which the largest counts.
    const bool is_same = !jumps.empty() && last == i - 1 &&
                         changes[i] * changes[jumps.back()] > 0.0;
    last = i;
    if (!is_same) {
      jumps.push_back(i);
    } else if (std::abs(changes[i]) > std::abs(changes[jumps.back()])) {
      jumps.back() = i;
    }
  }
  for (size_t k = 1; k < jumps.size(); ++k) {
    const size_t begin = jumps[k - 1], end = jumps[k];
    if (changes[begin] * changes[end] > 0.0 ||
        times_ns[end] - times_ns[begin] > NsFromSeconds(kMaxSkidS)) {
      continue;
    }
    Mark(begin, end, skids);
    ++k;  // This jump has its partner.
  }
}

}  // namespace

int LeaveOutSkids(std::vector<WheelSpeed>* speeds) {
  std::vector<bool> skids(speeds->size(), false);
  MarkTurns(*speeds, &skids);
  MarkJumps(*speeds, &skids);
  std::vector<WheelSpeed> kept;
  int num_stretches = 0;
  for (size_t i = 0; i < speeds->size(); ++i) {
    if (!skids[i]) {
      kept.push_back((*speeds)[i]);
    } else if (i == 0 || !skids[i - 1]) {
      ++num_stretches;
    }
  }
  if (speeds->size() - kept.size() > kMaxSkidRatio * speeds->size()) return 0;
  *speeds = std::move(kept);
  return num_stretches;
}

}  // namespace adasfm
