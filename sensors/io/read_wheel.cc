// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_wheel.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensors/io/log_checks.h"
#include "sensors/io/log_file.h"
#include "sensors/io/read_bag.h"

namespace adasfm {
namespace {

std::string TypeName(WheelType type) {
  switch (type) {
    case WheelType::kDifferential:
      return "differential";
    case WheelType::kVelocity:
      return "velocity";
    case WheelType::kSpeed:
      return "speed";
    case WheelType::kTicks:
      return "ticks";
    case WheelType::kEncoder:
      return "encoder";
    case WheelType::kSteering:
      return "steering";
    case WheelType::kOdometry:
      return "odometry";
  }
  return "unknown";
}

// The name of a header's column without its unit: "v_left [m s^-1]" -> v_left.
std::string ColumnName(std::string_view column) {
  const size_t begin = column.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return "";
  column.remove_prefix(begin);
  return std::string(column.substr(0, column.find_first_of(" \t[\r")));
}

std::vector<std::string> ColumnNames(std::string_view header) {
  std::vector<std::string> names;
  while (true) {
    const size_t end = header.find(',');
    names.push_back(ColumnName(header.substr(0, end)));
    if (end == std::string_view::npos) return names;
    header.remove_prefix(end + 1);
  }
}

StatusOr<WheelType> FindType(const LogFile& file) {
  const std::vector<std::string> names = ColumnNames(file.header());
  if (names.size() == 3) {
    if (names[1] == "v_left" && names[2] == "v_right") {
      return WheelType::kDifferential;
    }
    if (names[1] == "v" && names[2] == "omega") return WheelType::kVelocity;
    if (names[1] == "v" && names[2] == "steering") return WheelType::kSteering;
    if (names[1] == "ticks_left" && names[2] == "ticks_right") {
      return WheelType::kTicks;
    }
  }
  if (names.size() == 2 && names[1] == "v") return WheelType::kSpeed;
  if (names.size() == 2 && names[1] == "ticks") return WheelType::kEncoder;
  if (!file.has_commas() && file.Line(0).fields.size() == 8) {
    return WheelType::kOdometry;
  }
  return Status::Error(
      file.path() + ", line 1: the header '" + file.header().substr(0, 80) +
      "' is none of '#timestamp [ns],v_left [m s^-1],v_right [m s^-1]', "
      "'...,v [m s^-1],omega [rad s^-1]', '...,v [m s^-1]', "
      "'...,v [m s^-1],steering [rad]', '...,ticks_left,ticks_right', "
      "'...,ticks'; nor is the file a TUM trajectory");
}

// Faster than any machine with photos to match: larger values are in km/h or
// mm/s.
constexpr double kMaxSpeed = 120.0;
constexpr double kMaxYawRate = 20.0;
// No front wheel is steered by a larger angle.
constexpr double kMaxSteeringRad = 1.3;

// 4Seasons' times are whole nanoseconds, TUM's are decimal seconds.
bool ParseTumTime(std::string_view field, timestamp_t* timestamp_ns) {
  if (field.size() >= 15 && field.find('.') == std::string_view::npos) {
    return ParseNanoseconds(field, timestamp_ns);
  }
  return ParseSeconds(field, timestamp_ns);
}

Status ParsePose(const LogFile& file, const LogLine& line, OdometryPose* pose) {
  Status status =
      CheckNumFields(file, line, 8, "t, tx, ty, tz, qx, qy, qz, qw");
  if (!status.ok()) return status;
  if (!ParseTumTime(line.fields[0], &pose->timestamp_ns)) {
    return file.Error(line.number, "column 1 is '" +
                                       std::string(line.fields[0]) +
                                       "', not a time in seconds");
  }
  double values[7];
  status = ParseNumbers(file, line, 1, 7, values);
  if (!status.ok()) return status;
  const Eigen::Quaterniond rotation(values[6], values[3], values[4], values[5]);
  if (std::abs(rotation.norm() - 1.0) > 0.01) {
    return file.Error(line.number, "columns 5 to 8 are no unit quaternion");
  }
  pose->world_from_body =
      Rigid3d(rotation, Eigen::Vector3d(values[0], values[1], values[2]));
  return Status::Ok();
}

StatusOr<std::vector<OdometryPose>> CheckPoseTimes(
    std::vector<OdometryPose> poses, const LogOrigin& origin,
    std::vector<std::string>* warnings) {
  std::vector<timestamp_t> times;
  for (const OdometryPose& pose : poses) times.push_back(pose.timestamp_ns);
  const Status status = CheckLogTimes(times, origin, warnings);
  if (!status.ok()) return status;
  return poses;
}

}  // namespace

Status CheckWheelUnits(const std::vector<WheelSample>& samples, WheelType type,
                       const LogOrigin& origin) {
  if (CountsTicks(type)) return Status::Ok();
  const bool has_two_speeds = type == WheelType::kDifferential;
  for (size_t i = 0; i < samples.size(); ++i) {
    const WheelSample& sample = samples[i];
    const double speed = std::max(
        std::abs(sample.first), has_two_speeds ? std::abs(sample.second) : 0.0);
    if (speed > kMaxSpeed) {
      return Status::Error(origin.Locate(i) + ": a speed of " +
                           std::to_string(speed) +
                           " m/s; the log seems to be in km/h or mm/s (m/s "
                           "are expected)");
    }
    if (type == WheelType::kVelocity && std::abs(sample.second) > kMaxYawRate) {
      return Status::Error(origin.Locate(i) + ": a yaw rate of " +
                           std::to_string(sample.second) +
                           " rad/s; the log seems to be in deg/s (rad/s are "
                           "expected)");
    }
    if (type == WheelType::kSteering &&
        std::abs(sample.second) > kMaxSteeringRad) {
      return Status::Error(origin.Locate(i) + ": a steering angle of " +
                           std::to_string(sample.second) +
                           " rad; the log seems to be in degrees, or of the "
                           "steering wheel (rad of the front wheels are "
                           "expected)");
    }
  }
  return Status::Ok();
}

StatusOr<WheelType> ReadWheelType(const std::string& path) {
  const StatusOr<LogFile> file = LogFile::Read(path);
  if (!file.ok()) return file.status();
  return FindType(*file);
}

namespace {

// Units are not checked with origin_out: its owner calls CheckWheelUnits.
Status CheckSamples(const std::vector<WheelSample>& samples, WheelType type,
                    LogOrigin origin, std::vector<std::string>* warnings,
                    LogOrigin* origin_out) {
  std::vector<timestamp_t> times;
  for (const WheelSample& sample : samples) {
    times.push_back(sample.timestamp_ns);
  }
  Status status = CheckLogTimes(times, origin, warnings);
  if (status.ok() && origin_out == nullptr) {
    status = CheckWheelUnits(samples, type, origin);
  }
  if (status.ok() && origin_out != nullptr) *origin_out = std::move(origin);
  return status;
}

}  // namespace

StatusOr<std::vector<WheelSample>> ReadWheel(const std::string& path,
                                             WheelType expected_type,
                                             std::vector<std::string>* warnings,
                                             LogOrigin* origin_out) {
  if (IsBagPath(path)) {
    StatusOr<std::vector<WheelSample>> bag =
        ReadBagWheel(path, expected_type, warnings);
    if (!bag.ok()) return bag;
    const Status status = CheckSamples(
        *bag, expected_type, LogOrigin::Numbered(path, bag->size(), "message"),
        warnings, origin_out);
    if (!status.ok()) return status;
    return bag;
  }
  const StatusOr<LogFile> file = LogFile::Read(path);
  if (!file.ok()) return file.status();
  const StatusOr<WheelType> type = FindType(*file);
  if (!type.ok()) return type.status();
  if (*type != expected_type || *type == WheelType::kOdometry) {
    return Status::Error(path + ", line 1: the log is of type " +
                         TypeName(*type) + " where the calibration says " +
                         TypeName(expected_type) +
                         "; set wheel0/type in the calibration");
  }
  const bool has_one_column =
      *type == WheelType::kSpeed || *type == WheelType::kEncoder;
  LogOrigin origin;
  origin.path = path;
  std::vector<WheelSample> samples;
  for (size_t i = 0; i < file->num_lines(); ++i) {
    const LogLine line = file->Line(i);
    Status status = CheckNumFields(*file, line, has_one_column ? 2 : 3,
                                   "as its header says");
    if (!status.ok()) return status;
    WheelSample sample;
    status = ParseTime(*file, line, &sample.timestamp_ns);
    if (!status.ok()) return status;
    double values[2] = {0.0, 0.0};
    status = ParseNumbers(*file, line, 1, has_one_column ? 1 : 2, values);
    if (!status.ok()) return status;
    sample.first = values[0];
    sample.second = values[1];
    samples.push_back(sample);
    origin.line_numbers.push_back(line.number);
  }
  const Status status =
      CheckSamples(samples, *type, std::move(origin), warnings, origin_out);
  if (!status.ok()) return status;
  return samples;
}

StatusOr<std::vector<OdometryPose>> ReadOdometry(
    const std::string& path, std::vector<std::string>* warnings) {
  if (IsBagPath(path)) {
    StatusOr<std::vector<OdometryPose>> bag = ReadBagOdometry(path, warnings);
    if (!bag.ok()) return bag.status();
    const LogOrigin origin = LogOrigin::Numbered(path, bag->size(), "message");
    return CheckPoseTimes(std::move(*bag), origin, warnings);
  }
  const StatusOr<LogFile> file = LogFile::Read(path);
  if (!file.ok()) return file.status();
  LogOrigin origin;
  origin.path = path;
  std::vector<OdometryPose> poses;
  for (size_t i = 0; i < file->num_lines(); ++i) {
    const LogLine line = file->Line(i);
    OdometryPose pose;
    const Status status = ParsePose(*file, line, &pose);
    if (!status.ok()) return status;
    poses.push_back(pose);
    origin.line_numbers.push_back(line.number);
  }
  return CheckPoseTimes(std::move(poses), origin, warnings);
}

}  // namespace adasfm
