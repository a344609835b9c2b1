// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/write_bag_logs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iomanip>
#include <set>
#include <sstream>

#include "colmap_ext/datasets/dataset_files.h"
#include "colmap_ext/io/output_files.h"
#include "sensors/io/calibration.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

// All digits of a double.
std::ostringstream ExactStream() {
  std::ostringstream text;
  text << std::setprecision(17);
  return text;
}

std::string FormatImu(const std::vector<ImuSample>& samples) {
  std::ostringstream text = ExactStream();
  text << "#timestamp [ns],w_x [rad s^-1],w_y [rad s^-1],w_z [rad s^-1],"
          "a_x [m s^-2],a_y [m s^-2],a_z [m s^-2]\n";
  for (const ImuSample& sample : samples) {
    const Eigen::Vector3d& w = sample.angular_velocity;
    const Eigen::Vector3d& a = sample.specific_force;
    text << sample.timestamp_ns << "," << w.x() << "," << w.y() << "," << w.z()
         << "," << a.x() << "," << a.y() << "," << a.z() << "\n";
  }
  return text.str();
}

std::string FormatWheel(const BagLogs& logs) {
  std::ostringstream text = ExactStream();
  const bool is_speed = logs.wheel_type == WheelType::kSpeed;
  if (logs.wheel_type == WheelType::kTicks) {
    text << "#timestamp [ns],ticks_left,ticks_right\n";
  } else {
    text << "#timestamp [ns],v [m s^-1]"
         << (is_speed ? "\n" : ",omega [rad s^-1]\n");
  }
  for (const WheelSample& sample : logs.wheel) {
    text << sample.timestamp_ns << "," << sample.first;
    if (!is_speed) text << "," << sample.second;
    text << "\n";
  }
  return text.str();
}

// TUM format. Times are in seconds, since nanoseconds of a simulation's clock
// have too few digits to be recognised as nanoseconds.
std::string FormatOdometry(const std::vector<OdometryPose>& poses) {
  std::ostringstream text = ExactStream();
  text << "#t [s] tx ty tz [m] qx qy qz qw\n";
  for (const OdometryPose& pose : poses) {
    char seconds[40];
    std::snprintf(seconds, sizeof(seconds), "%lld.%09lld",
                  static_cast<long long>(pose.timestamp_ns / 1'000'000'000),
                  static_cast<long long>(pose.timestamp_ns % 1'000'000'000));
    const Eigen::Vector3d& t = pose.world_from_body.translation;
    const Eigen::Quaterniond& q = pose.world_from_body.rotation;
    text << seconds << " " << t.x() << " " << t.y() << " " << t.z() << " "
         << q.x() << " " << q.y() << " " << q.z() << " " << q.w() << "\n";
  }
  return text.str();
}

std::string FormatGnss(const std::vector<RosNavSatFix>& fixes) {
  std::ostringstream text = ExactStream();
  text << "#timestamp [ns],latitude [deg],longitude [deg],altitude [m],"
          "sigma_east [m],sigma_north [m],sigma_up [m]\n";
  for (const RosNavSatFix& fix : fixes) {
    text << fix.header.stamp_ns << "," << fix.latitude << "," << fix.longitude
         << "," << fix.altitude;
    // 0 where the receiver states none.
    for (const int i : {0, 4, 8}) {
      const double variance =
          fix.covariance_type == 0 ? 0.0 : fix.position_covariance[i];
      text << "," << (variance > 0.0 ? std::sqrt(variance) : 0.0);
    }
    text << "\n";
  }
  return text.str();
}

std::string FormatTransform(const std::string& name,
                            const Rigid3d& target_from_source) {
  std::ostringstream text = ExactStream();
  const Eigen::Matrix<double, 3, 4> matrix = target_from_source.ToMatrix();
  text << "  " << name << ":\n";
  for (int row = 0; row < 3; ++row) {
    text << "    - [" << matrix(row, 0) << ", " << matrix(row, 1) << ", "
         << matrix(row, 2) << ", " << matrix(row, 3) << "]\n";
  }
  text << "    - [0, 0, 0, 1]\n";
  return text.str();
}

StatusOr<Rigid3d> RequireTransform(const std::string& bag_path,
                                   const BagLogs& logs,
                                   const std::string& target,
                                   const std::string& source) {
  const std::optional<Rigid3d> transform =
      FindTransform(logs.static_transforms, target, source);
  if (transform.has_value()) return *transform;
  std::set<std::string> frames;
  for (const RosTransform& edge : logs.static_transforms) {
    frames.insert({edge.parent, edge.child});
  }
  std::string list;
  for (const std::string& frame : frames) {
    list += (list.empty() ? "" : ", ") + frame;
  }
  return Status::Error(
      bag_path + ": /tf_static does not say how the frames '" + source +
      "' and '" + target + "' are mounted (it has " +
      (list.empty() ? "no frames" : list) +
      "); give a calibration with --sensors_path, or leave the sensors out "
      "with --imu_topic none --wheel_topic none");
}

bool HasWheels(const BagLogs& logs) {
  return !logs.wheel.empty() || !logs.odometry.empty();
}

}  // namespace

Status WriteBagLogs(const BagLogs& logs, const std::string& folder) {
  Status status;
  if (!logs.imu.empty()) {
    status = WriteTextFile(folder + "/imu.csv", FormatImu(logs.imu));
  }
  if (status.ok() && HasWheels(logs)) {
    status =
        WriteTextFile(folder + "/wheel.csv",
                      logs.odometry.empty() ? FormatWheel(logs)
                                            : FormatOdometry(logs.odometry));
  }
  if (status.ok() && !logs.gnss.empty()) {
    status = WriteTextFile(folder + "/gnss.csv", FormatGnss(logs.gnss));
  }
  return status;
}

StatusOr<std::string> FormatBagCalibration(const std::string& bag_path,
                                           const BagLogs& logs) {
  // Without an IMU, the wheels' frame replaces the IMU's frame.
  const bool has_imu = !logs.imu.empty();
  const std::string& body = has_imu ? logs.imu_frame : logs.wheel_frame;
  const StatusOr<Rigid3d> cam_from_body =
      RequireTransform(bag_path, logs, logs.image_frame, body);
  if (!cam_from_body.ok()) return cam_from_body.status();
  ImuDescription imu;
  if (has_imu) {
    std::vector<timestamp_t> times;
    for (const ImuSample& sample : logs.imu) {
      times.push_back(sample.timestamp_ns);
    }
    const double period_s = ComputeMedianPeriod(times);
    if (period_s > 0.0) imu.rate_hz = 1.0 / period_s;
  }
  std::string text = "# Extrinsics from " + bag_path +
                     "; noise: typical values, which no bag tells.\n" +
                     FormatSensorsYaml(*cam_from_body, 0.0, imu);
  if (!HasWheels(logs)) return text;
  const StatusOr<Rigid3d> body_from_wheel =
      has_imu ? RequireTransform(bag_path, logs, body, logs.wheel_frame)
              : StatusOr<Rigid3d>(Rigid3d());
  if (!body_from_wheel.ok()) return body_from_wheel.status();
  const SensorCalibration defaults;
  std::ostringstream wheel = ExactStream();
  wheel << "wheel0:\n  type: "
        << (logs.odometry.empty() ? "velocity" : "odometry")
        << "\n  speed_noise: " << defaults.wheel_speed_noise
        << "\n  yaw_rate_noise: " << defaults.wheel_yaw_rate_noise << "\n"
        << FormatTransform("T_imu_wheel", *body_from_wheel);
  return text + wheel.str();
}

}  // namespace adasfm
