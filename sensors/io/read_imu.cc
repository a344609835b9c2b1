// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_imu.h"

#include <filesystem>

#include "sensors/io/log_checks.h"
#include "sensors/io/log_file.h"
#include "sensors/io/read_bag.h"
#include "sensors/io/read_kitti_oxts.h"

namespace adasfm {

StatusOr<std::vector<ImuSample>> ReadImuSamples(
    const std::string& path, std::vector<std::string>* warnings,
    LogOrigin* origin_out) {
  LogOrigin& origin = *origin_out;
  origin = {path, {}, "line"};
  std::vector<ImuSample> samples;
  std::vector<timestamp_t> times;
  std::error_code error;
  if (IsBagPath(path)) {
    StatusOr<std::vector<ImuSample>> bag = ReadBagImu(path, warnings);
    if (!bag.ok()) return bag.status();
    samples = std::move(*bag);
    origin = LogOrigin::Numbered(path, samples.size(), "message");
  } else if (std::filesystem::is_directory(path, error)) {
    StatusOr<std::vector<ImuSample>> oxts = ReadKittiOxts(path);
    if (!oxts.ok()) return oxts.status();
    samples = std::move(*oxts);
    origin =
        LogOrigin::Numbered(path + "/timestamps.txt", samples.size(), "line");
  } else {
    StatusOr<LogFile> file = LogFile::Read(path);
    if (!file.ok()) return file.status();
    for (size_t i = 0; i < file->num_lines(); ++i) {
      const LogLine line = file->Line(i);
      Status status =
          CheckNumFields(*file, line, 7, "ns, wx, wy, wz, ax, ay, az");
      if (!status.ok()) return status;
      ImuSample sample;
      status = ParseTime(*file, line, &sample.timestamp_ns);
      if (!status.ok()) return status;
      double values[6];
      status = ParseNumbers(*file, line, 1, 6, values);
      if (!status.ok()) return status;
      sample.angular_velocity << values[0], values[1], values[2];
      sample.specific_force << values[3], values[4], values[5];
      samples.push_back(sample);
      origin.line_numbers.push_back(line.number);
    }
  }
  for (const ImuSample& sample : samples) times.push_back(sample.timestamp_ns);
  const Status status = CheckLogTimes(times, origin, warnings);
  if (!status.ok()) return status;
  return samples;
}

StatusOr<std::vector<ImuSample>> ReadImu(const std::string& path,
                                         std::vector<std::string>* warnings) {
  LogOrigin origin;
  StatusOr<std::vector<ImuSample>> samples =
      ReadImuSamples(path, warnings, &origin);
  if (!samples.ok()) return samples;
  const Status status = CheckImuUnits(*samples, origin);
  if (!status.ok()) return status;
  return samples;
}

}  // namespace adasfm
