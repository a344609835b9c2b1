// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_kitti_oxts.h"

#include <cstdio>

#include "sensors/io/log_file.h"

namespace adasfm {
namespace {

// The least number of columns that holds both triples; later columns vary.
constexpr size_t kMinNumFields = 20;
constexpr size_t kForceField = 11;
constexpr size_t kRateField = 17;
constexpr timestamp_t kSecondNs = 1'000'000'000;

// Days since 1970-01-01 in the Gregorian calendar, from the day count of whole
// years that begin in March, so that a leap day ends its year.
int64_t DaysSinceEpoch(int64_t year, int64_t month, int64_t day) {
  const int64_t march_year = month <= 2 ? year - 1 : year;
  const int64_t march_month = (month + 9) % 12;
  const int64_t days = 365 * march_year + march_year / 4 - march_year / 100 +
                       march_year / 400 + (153 * march_month + 2) / 5 + day - 1;
  constexpr int64_t kDaysToEpoch = 719468;
  return days - kDaysToEpoch;
}

// "2011-09-26 13:02:25.594360375".
bool ParseDateTime(const LogLine& line, timestamp_t* timestamp_ns) {
  if (line.fields.size() != 2) return false;
  const std::string_view date = line.fields[0], time = line.fields[1];
  int64_t year, month, day, hour, minute;
  timestamp_t seconds_ns;
  if (date.size() != 10 || time.size() < 8) return false;
  if (!ParseInt64(date.substr(0, 4), &year) ||
      !ParseInt64(date.substr(5, 2), &month) ||
      !ParseInt64(date.substr(8, 2), &day) ||
      !ParseInt64(time.substr(0, 2), &hour) ||
      !ParseInt64(time.substr(3, 2), &minute) ||
      !ParseSeconds(time.substr(6), &seconds_ns)) {
    return false;
  }
  if (year < 1970 || year > 2200 || month < 1 || month > 12 || day < 1 ||
      day > 31 || hour < 0 || hour > 23 || minute < 0 || minute > 59 ||
      seconds_ns >= 61 * kSecondNs) {
    return false;
  }
  const int64_t minutes =
      (DaysSinceEpoch(year, month, day) * 24 + hour) * 60 + minute;
  *timestamp_ns = minutes * 60 * kSecondNs + seconds_ns;
  return true;
}

}  // namespace

StatusOr<std::vector<ImuSample>> ReadKittiOxts(const std::string& folder) {
  const StatusOr<LogFile> times = LogFile::Read(folder + "/timestamps.txt");
  if (!times.ok()) return times.status();
  std::vector<ImuSample> samples;
  for (size_t i = 0; i < times->num_lines(); ++i) {
    const LogLine time_line = times->Line(i);
    ImuSample sample;
    if (!ParseDateTime(time_line, &sample.timestamp_ns)) {
      return times->Error(time_line.number,
                          "is not 'YYYY-MM-DD hh:mm:ss.fraction'");
    }
    char name[32];
    std::snprintf(name, sizeof(name), "/data/%010zu.txt", i);
    const StatusOr<LogFile> data = LogFile::Read(folder + name);
    if (!data.ok()) return data.status();
    const LogLine line = data->Line(0);
    if (line.fields.size() < kMinNumFields) {
      return data->Error(line.number, "has " +
                                          std::to_string(line.fields.size()) +
                                          " columns; an oxts packet has 30");
    }
    double values[3];
    Status status = ParseNumbers(*data, line, kForceField, 3, values);
    if (!status.ok()) return status;
    sample.specific_force << values[0], values[1], values[2];
    status = ParseNumbers(*data, line, kRateField, 3, values);
    if (!status.ok()) return status;
    sample.angular_velocity << values[0], values[1], values[2];
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace adasfm
