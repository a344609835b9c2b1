// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/types.h"
#include "sensors/io/log_checks.h"

namespace adasfm {

// What can be wrong with single samples of a log.
enum class LogFaultKind {
  kNone,
  kSpike,       // far from the samples around it
  kFrozen,      // repeats the reading before it
  kZero,        // zero where the sensor cannot read zero
  kSaturated,   // at the end of the sensor's range
  kDuplicated,  // repeats a stretch of readings that came before
  kImpossible,  // beyond what any such sensor measures
};

// Successive samples with the same fault.
struct LogFault {
  LogFaultKind kind = LogFaultKind::kNone;
  std::string path;
  const char* unit = "line";  // what first and last count
  size_t first = 0;
  size_t last = 0;
  int num_samples = 0;
  double duration_s = 0.0;
};

// The faults of a log in order of time, from the kind of each sample.
std::vector<LogFault> CollectFaults(const std::vector<LogFaultKind>& kinds,
                                    const std::vector<timestamp_t>& times_ns,
                                    const LogOrigin& origin);

// For JSON: "spike", "frozen", ...
const char* FaultName(LogFaultKind kind);

// One line a kind: path, the first ten places, count, what became of them.
std::vector<std::string> DescribeFaults(const std::vector<LogFault>& faults);

}  // namespace adasfm
