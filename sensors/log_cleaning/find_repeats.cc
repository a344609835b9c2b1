// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/find_repeats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/median.h"

namespace adasfm {
namespace {

constexpr double kUsualRuns = 5.0;
constexpr size_t kMinDuplicated = 10;
constexpr int kMinSaturated = 6;
constexpr int kMinSaturatedInARow = 3;
// An axis whose readings repeat the one before less often than this is not
// quantised. On other axes saturation is at least so many robust standard
// deviations from the median.
constexpr double kMaxRepeatShare = 0.01;
constexpr double kSaturationRatio = 6.0;
// Second differences divided by first differences: 1.7 for white noise, 0.6 for
// KITTI's filtered log, a hundredth for smooth motion.
constexpr double kMinNoiseRatio = 0.1;

bool IsEqual(const ImuReading& a, const ImuReading& b, int first_axis,
             int num_axes) {
  return a.segment(first_axis, num_axes) == b.segment(first_axis, num_axes);
}

// Lengths of the runs of equal readings.
std::vector<size_t> RunLengths(const std::vector<ImuReading>& readings,
                               int first_axis, int num_axes) {
  std::vector<size_t> lengths;
  for (size_t i = 0; i < readings.size(); ++i) {
    if (i > 0 && IsEqual(readings[i], readings[i - 1], first_axis, num_axes)) {
      ++lengths.back();
    } else {
      lengths.push_back(1);
    }
  }
  return lengths;
}

// Whether the values at the end of the axis (the largest of sign * reading)
// cannot be noise: there are many, several in a row, and either other values
// hardly ever repeat or the end is far from the median.
bool IsSaturated(const std::vector<double>& values, double end) {
  int num_at_end = 0, run = 0, longest = 0, num_repeats = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    run = values[i] == end ? run + 1 : 0;
    num_at_end += values[i] == end;
    longest = std::max(longest, run);
    num_repeats += i > 0 && values[i] != end && values[i] == values[i - 1];
  }
  if (num_at_end < kMinSaturated || longest < kMinSaturatedInARow) return false;
  if (num_repeats < kMaxRepeatShare * values.size()) return true;
  std::vector<double> distances = values;
  const double median = UpperMedian(&distances);
  for (double& value : distances) value = std::abs(value - median);
  const double sigma = 1.4826 * UpperMedian(&distances);
  return end - median > kSaturationRatio * sigma;
}

}  // namespace

bool HasNoise(const std::vector<ImuReading>& readings) {
  std::vector<double> first, second;
  for (size_t i = 2; i < readings.size(); ++i) {
    const ImuReading step = readings[i] - readings[i - 1];
    first.push_back(step.cwiseAbs().maxCoeff());
    second.push_back(
        (step - readings[i - 1] + readings[i - 2]).cwiseAbs().maxCoeff());
  }
  const double step = UpperMedian(&first);
  return step > 0.0 && UpperMedian(&second) > kMinNoiseRatio * step;
}

std::vector<bool> FindFrozen(const std::vector<ImuReading>& readings,
                             int first_axis, int num_axes,
                             size_t min_num_samples) {
  const std::vector<size_t> lengths =
      RunLengths(readings, first_axis, num_axes);
  std::vector<size_t> sorted = lengths;
  std::sort(sorted.begin(), sorted.end());
  const size_t usual = sorted.empty() ? 1 : sorted[(99 * sorted.size()) / 100];
  const size_t limit = std::max<size_t>(
      min_num_samples, static_cast<size_t>(kUsualRuns * usual));
  std::vector<bool> is_frozen(readings.size(), false);
  size_t begin = 0;
  for (const size_t length : lengths) {
    // The first reading of a run was measured, but at which of them the log
    // froze, and whether in time, is unknown: all are marked.
    if (length >= limit) {
      std::fill(is_frozen.begin() + begin, is_frozen.begin() + begin + length,
                true);
    }
    begin += length;
  }
  return is_frozen;
}

size_t LongestRun(const std::vector<ImuReading>& readings, int first_axis,
                  int num_axes) {
  const std::vector<size_t> lengths =
      RunLengths(readings, first_axis, num_axes);
  return lengths.empty() ? 0
                         : *std::max_element(lengths.begin(), lengths.end());
}

std::vector<bool> FindDuplicated(const std::vector<ImuReading>& readings) {
  const auto as_array = [](const ImuReading& reading) {
    std::array<double, 6> key;
    for (int axis = 0; axis < 6; ++axis) key[axis] = reading[axis];
    return key;
  };
  // The first occurrence of each reading.
  std::map<std::array<double, 6>, size_t> first_seen;
  std::vector<size_t> origins(readings.size());
  for (size_t i = 0; i < readings.size(); ++i) {
    origins[i] = first_seen.emplace(as_array(readings[i]), i).first->second;
  }
  std::vector<bool> is_duplicated(readings.size(), false);
  for (size_t begin = 0; begin < readings.size();) {
    size_t end = begin + 1;
    while (end < readings.size() && origins[end] == origins[end - 1] + 1) ++end;
    if (origins[begin] != begin && end - begin >= kMinDuplicated) {
      std::fill(is_duplicated.begin() + begin, is_duplicated.begin() + end,
                true);
    }
    begin = end;
  }
  return is_duplicated;
}

std::vector<bool> FindSaturated(const std::vector<ImuReading>& readings) {
  std::vector<bool> is_saturated(readings.size(), false);
  if (!HasNoise(readings)) return is_saturated;
  std::vector<double> values(readings.size());
  for (int axis = 0; axis < 6; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      for (size_t i = 0; i < values.size(); ++i) {
        values[i] = sign * readings[i][axis];
      }
      const double end = *std::max_element(values.begin(), values.end());
      if (!IsSaturated(values, end)) continue;
      for (size_t i = 0; i < values.size(); ++i) {
        if (values[i] == end) is_saturated[i] = true;
      }
    }
  }
  return is_saturated;
}

}  // namespace adasfm
