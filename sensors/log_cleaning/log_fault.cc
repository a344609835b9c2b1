// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/log_fault.h"

#include "sensors/io/format_figures.h"

namespace adasfm {
namespace {

constexpr size_t kMaxPlacesNamed = 10;

std::string Place(const LogFault& fault) {
  const std::string first = std::to_string(fault.first);
  return fault.first == fault.last ? first
                                   : first + "-" + std::to_string(fault.last);
}

// The text after "7 samples".
const char* Cause(LogFaultKind kind, bool is_one) {
  switch (kind) {
    case LogFaultKind::kNone:
      return "";
    case LogFaultKind::kSpike:
      return is_one ? "is a spike, far from the samples around it"
                    : "are spikes, far from the samples around them";
    case LogFaultKind::kFrozen:
      return is_one ? "repeats the reading before it"
                    : "repeat the same reading";
    case LogFaultKind::kZero:
      return is_one ? "is all zero" : "are all zero";
    case LogFaultKind::kSaturated:
      return is_one ? "is at the end of the sensor's range"
                    : "are at the end of the sensor's range";
    case LogFaultKind::kDuplicated:
      return is_one ? "repeats an earlier reading"
                    : "repeat an earlier stretch of the log";
    case LogFaultKind::kImpossible:
      return is_one ? "is beyond what such a sensor measures"
                    : "are beyond what such a sensor measures";
  }
  return "";
}

}  // namespace

std::vector<LogFault> CollectFaults(const std::vector<LogFaultKind>& kinds,
                                    const std::vector<timestamp_t>& times_ns,
                                    const LogOrigin& origin) {
  const double period_s = ComputeMedianPeriod(times_ns);
  std::vector<LogFault> faults;
  for (size_t begin = 0; begin < kinds.size();) {
    size_t end = begin + 1;
    while (end < kinds.size() && kinds[end] == kinds[begin]) ++end;
    if (kinds[begin] != LogFaultKind::kNone) {
      LogFault fault;
      fault.kind = kinds[begin];
      fault.path = origin.path;
      fault.unit = origin.unit;
      fault.first = origin.line_numbers[begin];
      fault.last = origin.line_numbers[end - 1];
      fault.num_samples = end - begin;
      fault.duration_s =
          SecondsFromNs(times_ns[end - 1] - times_ns[begin]) + period_s;
      faults.push_back(fault);
    }
    begin = end;
  }
  return faults;
}

const char* FaultName(LogFaultKind kind) {
  switch (kind) {
    case LogFaultKind::kNone:
      return "none";
    case LogFaultKind::kSpike:
      return "spike";
    case LogFaultKind::kFrozen:
      return "frozen";
    case LogFaultKind::kZero:
      return "zero";
    case LogFaultKind::kSaturated:
      return "saturated";
    case LogFaultKind::kDuplicated:
      return "duplicated";
    case LogFaultKind::kImpossible:
      return "impossible";
  }
  return "";
}

std::vector<std::string> DescribeFaults(const std::vector<LogFault>& faults) {
  std::vector<std::string> lines;
  for (const LogFaultKind kind :
       {LogFaultKind::kSpike, LogFaultKind::kFrozen, LogFaultKind::kZero,
        LogFaultKind::kSaturated, LogFaultKind::kDuplicated,
        LogFaultKind::kImpossible}) {
    std::string places;
    size_t num_places = 0;
    int num_samples = 0;
    double seconds = 0.0;
    const LogFault* first = nullptr;
    for (const LogFault& fault : faults) {
      if (fault.kind != kind) continue;
      if (first == nullptr) first = &fault;
      num_samples += fault.num_samples;
      seconds += fault.duration_s;
      if (++num_places > kMaxPlacesNamed) continue;
      if (!places.empty()) places += ", ";
      places += Place(fault);
    }
    if (first == nullptr) continue;
    if (num_places > kMaxPlacesNamed) {
      places += " and " + std::to_string(num_places - kMaxPlacesNamed) +
                " more places (all are in the summary)";
    }
    const bool is_one = num_samples == 1;
    lines.push_back(first->path + ", " + first->unit + (is_one ? " " : "s ") +
                    places + ": " + std::to_string(num_samples) +
                    (is_one ? " sample " : " samples ") + Cause(kind, is_one) +
                    FormatFigures(" (%.3g s); left out", seconds));
  }
  return lines;
}

}  // namespace adasfm
