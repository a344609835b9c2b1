// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"
#include "sensors/io/log_checks.h"
#include "sensors/log_cleaning/log_fault.h"

namespace adasfm {

template <typename Sample>
struct CleanedLog {
  std::vector<Sample> samples;  // without the bad ones
  LogOrigin origin;             // of samples
  std::vector<LogFault> faults;
  // One line for each kind of fault, and one for missing samples.
  std::vector<std::string> warnings;
};

// Leaves bad samples out of an IMU log. samples are in order of time; origin is
// where they come from. The checks, in this order: samples of zero specific
// force, frozen sensors, repeated stretches, values beyond any sensor's range,
// saturation and spikes (find_repeats.h, find_spikes.h). The holes are bridged,
// or become gaps, where the samples are used (sensors/bridged_holes.h). An
// error of one line when a sensor is dead (the same reading in half of the
// log), when more than a fifth of the samples is bad, or when the clock's unit
// is wrong.
StatusOr<CleanedLog<ImuSample>> CleanImu(const std::vector<ImuSample>& samples,
                                         const LogOrigin& origin);

// A warning when a log at a steady rate lacks more than 0.5 % of its samples;
// else an empty line.
std::string DescribeMissing(const std::vector<timestamp_t>& times_ns,
                            const LogOrigin& origin);

// An error for samples closer than 50 us: the times are not in nanoseconds.
Status CheckClockUnit(const std::vector<timestamp_t>& times_ns,
                      const LogOrigin& origin);

// The samples without a fault, and the faults.
template <typename Sample>
CleanedLog<Sample> LeaveOutFaults(const std::vector<Sample>& samples,
                                  const std::vector<LogFaultKind>& kinds,
                                  const LogOrigin& origin) {
  CleanedLog<Sample> cleaned;
  cleaned.origin = {origin.path, {}, origin.unit};
  std::vector<timestamp_t> times_ns;
  for (size_t i = 0; i < samples.size(); ++i) {
    times_ns.push_back(samples[i].timestamp_ns);
    if (kinds[i] != LogFaultKind::kNone) continue;
    cleaned.samples.push_back(samples[i]);
    cleaned.origin.line_numbers.push_back(origin.line_numbers[i]);
  }
  cleaned.faults = CollectFaults(kinds, times_ns, origin);
  cleaned.warnings = DescribeFaults(cleaned.faults);
  const std::string missing = DescribeMissing(times_ns, origin);
  if (!missing.empty()) cleaned.warnings.push_back(missing);
  return cleaned;
}

}  // namespace adasfm
