// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/clean_imu.h"

#include <algorithm>
#include <cmath>

#include "sensors/io/format_figures.h"
#include "sensors/log_cleaning/find_repeats.h"
#include "sensors/log_cleaning/find_spikes.h"

namespace adasfm {
namespace {

// Beyond twice the range of any MEMS gyroscope (4,000 deg/s) or of an
// accelerometer for crash tests (200 g).
constexpr double kMaxRate = 70.0;     // rad/s
constexpr double kMaxForce = 2000.0;  // m/s^2
// Smaller spikes (over 5 ms) change the rotation by less than 0.1 deg or the
// speed by less than 0.03 m/s: less than the noise over a link.
constexpr double kMinRateSpike = 0.3;   // rad/s
constexpr double kMinForceSpike = 5.0;  // m/s^2
constexpr size_t kMinFrozen = 6;        // all six axes
constexpr size_t kMinHalfFrozen = 12;   // of gyroscope or accelerometer alone
constexpr double kDeadShare = 0.5;
constexpr size_t kMinNumForDead = 100;
constexpr double kMaxBadImuShare = 0.2;
constexpr double kMinPeriodS = 50e-6;
constexpr double kMinMissingShare = 0.005;
constexpr double kHolePeriods = 1.5;
constexpr double kSteadyShare = 0.8;

ImuReading ToReading(const ImuSample& sample) {
  ImuReading reading;
  reading << sample.angular_velocity, sample.specific_force;
  return reading;
}

class ImuCleaner {
 public:
  ImuCleaner(const std::vector<ImuSample>& samples, const LogOrigin& origin)
      : samples_(samples),
        origin_(origin),
        kinds_(samples.size(), LogFaultKind::kNone) {
    for (const ImuSample& sample : samples) {
      times_ns_.push_back(sample.timestamp_ns);
    }
  }

  StatusOr<CleanedLog<ImuSample>> Run();

 private:
  Status CheckAlive() const;
  void MarkZeros();
  void MarkRepeats();
  void MarkImpossible();
  void MarkSpikes();
  // The readings that have no fault so far, and their indices.
  std::vector<ImuReading> GoodReadings(std::vector<size_t>* indices) const;
  void Mark(const std::vector<size_t>& indices, const std::vector<bool>& is_bad,
            LogFaultKind kind);

  const std::vector<ImuSample>& samples_;
  const LogOrigin& origin_;
  std::vector<timestamp_t> times_ns_;
  std::vector<LogFaultKind> kinds_;
};

std::vector<ImuReading> ImuCleaner::GoodReadings(
    std::vector<size_t>* indices) const {
  indices->clear();
  std::vector<ImuReading> readings;
  for (size_t i = 0; i < samples_.size(); ++i) {
    if (kinds_[i] != LogFaultKind::kNone) continue;
    indices->push_back(i);
    readings.push_back(ToReading(samples_[i]));
  }
  return readings;
}

void ImuCleaner::Mark(const std::vector<size_t>& indices,
                      const std::vector<bool>& is_bad, LogFaultKind kind) {
  for (size_t i = 0; i < indices.size(); ++i) {
    if (is_bad[i]) kinds_[indices[i]] = kind;
  }
}

Status ImuCleaner::CheckAlive() const {
  if (samples_.size() < kMinNumForDead) return Status::Ok();
  std::vector<size_t> indices;
  const std::vector<ImuReading> readings = GoodReadings(&indices);
  const char* names[] = {"gyroscope", "accelerometer"};
  bool is_dead[2];
  for (int i = 0; i < 2; ++i) {
    is_dead[i] = LongestRun(readings, 3 * i, 3) > kDeadShare * samples_.size();
  }
  // A simulation at rest repeats both: useless, but not dead.
  if (is_dead[0] == is_dead[1] && !readings.front().isZero(0.0)) {
    return Status::Ok();
  }
  for (int i = 0; i < 2; ++i) {
    if (!is_dead[i]) continue;
    return Status::Error(origin_.path + ": the " + names[i] +
                         " holds the same reading over more than half of the "
                         "log; it is dead, or its columns were not filled");
  }
  return Status::Ok();
}

void ImuCleaner::MarkZeros() {
  for (size_t i = 0; i < samples_.size(); ++i) {
    // No accelerometer on Earth reads zero on all axes.
    if (samples_[i].specific_force.isZero(0.0)) kinds_[i] = LogFaultKind::kZero;
  }
}

void ImuCleaner::MarkRepeats() {
  std::vector<size_t> indices;
  std::vector<ImuReading> readings = GoodReadings(&indices);
  if (!HasNoise(readings)) return;
  Mark(indices, FindFrozen(readings, 0, 6, kMinFrozen), LogFaultKind::kFrozen);
  for (const int axis : {0, 3}) {
    const std::vector<bool> is_frozen =
        FindFrozen(readings, axis, 3, kMinHalfFrozen);
    for (size_t i = 0; i < indices.size(); ++i) {
      if (!is_frozen[i]) continue;
      const bool is_zero = readings[i].segment(axis, 3).isZero(0.0);
      kinds_[indices[i]] =
          is_zero ? LogFaultKind::kZero : LogFaultKind::kFrozen;
    }
  }
  readings = GoodReadings(&indices);
  Mark(indices, FindDuplicated(readings), LogFaultKind::kDuplicated);
}

void ImuCleaner::MarkImpossible() {
  for (size_t i = 0; i < samples_.size(); ++i) {
    if (samples_[i].angular_velocity.cwiseAbs().maxCoeff() > kMaxRate ||
        samples_[i].specific_force.cwiseAbs().maxCoeff() > kMaxForce) {
      kinds_[i] = LogFaultKind::kImpossible;
    }
  }
}

void ImuCleaner::MarkSpikes() {
  std::vector<size_t> indices;
  const std::vector<ImuReading> readings = GoodReadings(&indices);
  const double period_s = ComputeMedianPeriod(times_ns_);
  for (const int axis : {0, 3}) {
    std::vector<Eigen::Vector3d> half;
    for (const ImuReading& reading : readings) {
      half.push_back(reading.segment<3>(axis));
    }
    Mark(indices,
         FindSpikes(half, period_s, axis == 0 ? kMinRateSpike : kMinForceSpike),
         LogFaultKind::kSpike);
  }
}

StatusOr<CleanedLog<ImuSample>> ImuCleaner::Run() {
  Status status = CheckClockUnit(times_ns_, origin_);
  if (status.ok() && !samples_.empty()) status = CheckAlive();
  if (!status.ok()) return status;
  MarkZeros();
  MarkRepeats();
  MarkImpossible();
  std::vector<size_t> indices;
  const std::vector<ImuReading> readings = GoodReadings(&indices);
  Mark(indices, FindSaturated(readings), LogFaultKind::kSaturated);
  MarkSpikes();
  CleanedLog<ImuSample> cleaned = LeaveOutFaults(samples_, kinds_, origin_);
  const size_t num_bad = samples_.size() - cleaned.samples.size();
  if (num_bad > kMaxBadImuShare * samples_.size()) {
    return Status::Error(
        origin_.path + ": " + std::to_string(num_bad) + " of " +
        std::to_string(samples_.size()) +
        " samples are bad; check units and driver, or record again. First: " +
        cleaned.warnings.front());
  }
  return cleaned;
}

}  // namespace

StatusOr<CleanedLog<ImuSample>> CleanImu(const std::vector<ImuSample>& samples,
                                         const LogOrigin& origin) {
  return ImuCleaner(samples, origin).Run();
}

std::string DescribeMissing(const std::vector<timestamp_t>& times_ns,
                            const LogOrigin& origin) {
  const double period_s = ComputeMedianPeriod(times_ns);
  if (period_s <= 0.0) return "";
  size_t num_steady = 0, num_holes = 0, num_missing = 0, first = 0;
  double longest_s = 0.0;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    const double step_s = SecondsFromNs(times_ns[i] - times_ns[i - 1]);
    if (std::abs(step_s / period_s - 1.0) < 0.2) ++num_steady;
    if (step_s < kHolePeriods * period_s) continue;
    if (num_holes++ == 0) first = i - 1;
    num_missing += std::llround(step_s / period_s) - 1;
    longest_s = std::max(longest_s, step_s);
  }
  const size_t total = times_ns.size() + num_missing;
  if (num_steady < kSteadyShare * times_ns.size() ||
      num_missing < kMinMissingShare * total) {
    return "";
  }
  return origin.Locate(first) + ": first of " + std::to_string(num_holes) +
         " places where samples are missing, " + std::to_string(num_missing) +
         " of " + std::to_string(total) +
         FormatFigures(
             " in all (%.2g %%), the longest for %.3g s; short holes are "
             "bridged with a larger uncertainty",
             100.0 * num_missing / total, longest_s);
}

Status CheckClockUnit(const std::vector<timestamp_t>& times_ns,
                      const LogOrigin& origin) {
  const double period_s = ComputeMedianPeriod(times_ns);
  if (times_ns.size() < 3 || period_s >= kMinPeriodS) return Status::Ok();
  return Status::Error(
      origin.Locate(0) +
      FormatFigures(": samples are %.3g s apart, %.3g a second; the times look "
                    "like microseconds: multiply them by 1000 (nanoseconds "
                    "are expected)",
                    period_s, 1.0 / std::max(period_s, 1e-9)));
}

}  // namespace adasfm
