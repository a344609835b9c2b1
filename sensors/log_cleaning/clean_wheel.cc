// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/clean_wheel.h"

#include <algorithm>
#include <cmath>

#include "sensors/log_cleaning/find_spikes.h"

namespace adasfm {
namespace {

// m/s: smaller spikes have as little effect as a wheel that slips for a moment.
constexpr double kMinSpike = 2.0;
// No wheel of a machine stops from this speed within one sample, m/s.
constexpr double kMinDrop = 0.5;
// Speeds that repeat in all digits for longer than this, and for five times as
// many samples as usual (encoders are coarse), are not measured.
constexpr double kMinFrozenS = 0.3;
constexpr double kUsualRunsOfSpeeds = 5.0;
constexpr double kMaxBadWheelShare = 0.5;

bool IsEqual(const WheelSample& a, const WheelSample& b) {
  return a.first == b.first && a.second == b.second;
}

double Speed(const WheelSample& sample, WheelType type) {
  return type == WheelType::kDifferential
             ? std::max(std::abs(sample.first), std::abs(sample.second))
             : std::abs(sample.first);
}

// Runs of equal samples as [begin, end).
std::vector<std::pair<size_t, size_t>> FindRuns(
    const std::vector<WheelSample>& samples) {
  std::vector<std::pair<size_t, size_t>> runs;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (i > 0 && IsEqual(samples[i], samples[i - 1])) {
      ++runs.back().second;
    } else {
      runs.emplace_back(i, i + 1);
    }
  }
  return runs;
}

void MarkRuns(const std::vector<WheelSample>& samples, WheelType type,
              double period_s, std::vector<LogFaultKind>* kinds) {
  const std::vector<std::pair<size_t, size_t>> runs = FindRuns(samples);
  std::vector<size_t> lengths;
  for (const auto& [begin, end] : runs) {
    if (Speed(samples[begin], type) > 0.0) lengths.push_back(end - begin);
  }
  if (lengths.empty()) return;
  std::sort(lengths.begin(), lengths.end());
  const double limit =
      std::max(kMinFrozenS / period_s,
               kUsualRunsOfSpeeds * lengths[(99 * lengths.size()) / 100]);
  for (const auto& [begin, end] : runs) {
    const double speed = Speed(samples[begin], type);
    if (speed == 0.0 || end - begin <= limit) continue;
    std::fill(kinds->begin() + begin, kinds->begin() + end,
              LogFaultKind::kFrozen);
  }
}

// From at least kMinDrop to zero and back, both in one step.
void MarkDropOuts(const std::vector<WheelSample>& samples,
                  double WheelSample::*reading,
                  std::vector<LogFaultKind>* kinds) {
  for (size_t begin = 1; begin < samples.size(); ++begin) {
    if (samples[begin].*reading != 0.0 ||
        std::abs(samples[begin - 1].*reading) < kMinDrop) {
      continue;
    }
    size_t end = begin;
    while (end < samples.size() && samples[end].*reading == 0.0) ++end;
    if (end < samples.size() && std::abs(samples[end].*reading) > kMinDrop) {
      std::fill(kinds->begin() + begin, kinds->begin() + end,
                LogFaultKind::kZero);
    }
    begin = end;
  }
}

}  // namespace

StatusOr<CleanedLog<WheelSample>> CleanWheel(
    const std::vector<WheelSample>& samples, WheelType type,
    const LogOrigin& origin) {
  std::vector<timestamp_t> times_ns;
  for (const WheelSample& sample : samples) {
    times_ns.push_back(sample.timestamp_ns);
  }
  const Status status = CheckClockUnit(times_ns, origin);
  if (!status.ok()) return status;
  const double period_s = ComputeMedianPeriod(times_ns);
  std::vector<LogFaultKind> kinds(samples.size(), LogFaultKind::kNone);
  if (!CountsTicks(type) && period_s > 0.0) {
    MarkRuns(samples, type, period_s, &kinds);
    MarkDropOuts(samples, &WheelSample::first, &kinds);
    if (type == WheelType::kDifferential) {
      MarkDropOuts(samples, &WheelSample::second, &kinds);
    }
    std::vector<Eigen::Vector3d> readings;
    std::vector<size_t> indices;
    for (size_t i = 0; i < samples.size(); ++i) {
      if (kinds[i] != LogFaultKind::kNone) continue;
      indices.push_back(i);
      readings.emplace_back(samples[i].first, samples[i].second, 0.0);
    }
    const std::vector<bool> is_spike =
        FindSpikes(readings, period_s, kMinSpike);
    for (size_t i = 0; i < indices.size(); ++i) {
      if (is_spike[i]) kinds[indices[i]] = LogFaultKind::kSpike;
    }
  }
  CleanedLog<WheelSample> cleaned = LeaveOutFaults(samples, kinds, origin);
  const size_t num_bad = samples.size() - cleaned.samples.size();
  if (num_bad > kMaxBadWheelShare * samples.size()) {
    return Status::Error(origin.path + ": " + std::to_string(num_bad) + " of " +
                         std::to_string(samples.size()) +
                         " samples are bad; check units and driver. First: " +
                         cleaned.warnings.front());
  }
  return cleaned;
}

}  // namespace adasfm
