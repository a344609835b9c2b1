// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"

namespace adasfm {

// The origin of samples: the data line of each, for messages.
struct LogOrigin {
  std::string path;
  std::vector<size_t> line_numbers;
  const char* unit = "line";  // what is counted

  // Numbers 1, 2, ... for a log that does not consist of lines.
  static LogOrigin Numbered(const std::string& path, size_t num_samples,
                            const char* unit) {
    LogOrigin origin{path, {}, unit};
    for (size_t i = 1; i <= num_samples; ++i) origin.line_numbers.push_back(i);
    return origin;
  }

  std::string Locate(size_t index) const {
    return path + ", " + unit + " " + std::to_string(line_numbers[index]);
  }
};

// Times must increase: an error names the first line that goes back or repeats
// its predecessor. Gaps of more than three median periods become one warning
// that counts them and names the first and the longest.
Status CheckLogTimes(const std::vector<timestamp_t>& times_ns,
                     const LogOrigin& origin,
                     std::vector<std::string>* warnings);

// The median difference of successive times in seconds; 0 for fewer than two.
double ComputeMedianPeriod(const std::vector<timestamp_t>& times_ns);

// Units: degrees for radians, g for m/s^2, and |a| at rest off by more than 5 %
// are errors.
Status CheckImuUnits(const std::vector<ImuSample>& samples,
                     const LogOrigin& origin);

}  // namespace adasfm
