// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_kitti_oxts.h"

#include <cstdio>
#include <functional>

#include "sensors/io/calendar.h"
#include "sensors/io/log_file.h"

namespace adasfm {
namespace {

// The smallest number of columns with both triples; later columns vary.
constexpr size_t kMinNumFields = 20;
constexpr size_t kForceField = 11;
constexpr size_t kRateField = 17;
constexpr size_t kPositionSigmaField = 23;

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

// Calls read(time, file, line) for every packet.
Status ForEachPacket(const std::string& folder,
                     const std::function<Status(timestamp_t, const LogFile&,
                                                const LogLine&)>& read) {
  const StatusOr<LogFile> times = LogFile::Read(folder + "/timestamps.txt");
  if (!times.ok()) return times.status();
  for (size_t i = 0; i < times->num_lines(); ++i) {
    const LogLine time_line = times->Line(i);
    timestamp_t timestamp_ns = 0;
    if (!ParseDateTime(time_line, &timestamp_ns)) {
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
    const Status status = read(timestamp_ns, *data, line);
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

}  // namespace

StatusOr<std::vector<ImuSample>> ReadKittiOxts(const std::string& folder) {
  std::vector<ImuSample> samples;
  const auto read = [&](timestamp_t timestamp_ns, const LogFile& data,
                        const LogLine& line) {
    ImuSample sample;
    sample.timestamp_ns = timestamp_ns;
    double values[3];
    Status status = ParseNumbers(data, line, kForceField, 3, values);
    if (!status.ok()) return status;
    sample.specific_force << values[0], values[1], values[2];
    status = ParseNumbers(data, line, kRateField, 3, values);
    if (!status.ok()) return status;
    sample.angular_velocity << values[0], values[1], values[2];
    samples.push_back(sample);
    return status;
  };
  const Status status = ForEachPacket(folder, read);
  if (!status.ok()) return status;
  return samples;
}

StatusOr<std::vector<KittiOxtsFix>> ReadKittiOxtsFixes(
    const std::string& folder) {
  std::vector<KittiOxtsFix> fixes;
  const auto read = [&](timestamp_t timestamp_ns, const LogFile& data,
                        const LogLine& line) {
    double values[3];
    Status status = ParseNumbers(data, line, 0, 3, values);
    if (!status.ok()) return status;
    KittiOxtsFix fix{timestamp_ns, values[0], values[1], values[2], 0.0};
    if (line.fields.size() > kPositionSigmaField) {
      status = ParseNumbers(data, line, kPositionSigmaField, 1, &fix.sigma_m);
    }
    fixes.push_back(fix);
    return status;
  };
  const Status status = ForEachPacket(folder, read);
  if (!status.ok()) return status;
  return fixes;
}

}  // namespace adasfm
