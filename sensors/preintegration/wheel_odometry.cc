// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/preintegration/wheel_odometry.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/so3.h"

namespace adasfm {
namespace {

WheelSpeed Interpolate(const std::vector<WheelSpeed>& speeds,
                       timestamp_t time_ns) {
  if (speeds.empty() || time_ns < speeds.front().timestamp_ns ||
      time_ns > speeds.back().timestamp_ns) {
    throw std::invalid_argument("PreintegrateWheel: time outside the log");
  }
  const size_t next = IndexAfter(speeds, time_ns);
  if (next == speeds.size()) return speeds.back();
  const WheelSpeed& a = speeds[next - 1];
  const WheelSpeed& b = speeds[next];
  const double ratio = static_cast<double>(time_ns - a.timestamp_ns) /
                       (b.timestamp_ns - a.timestamp_ns);
  return {time_ns, a.speed + ratio * (b.speed - a.speed),
          a.yaw_rate + ratio * (b.yaw_rate - a.yaw_rate)};
}

// Speeds between successive counts, stamped in the middle.
std::vector<WheelSpeed> SpeedsFromTicks(const std::vector<WheelSample>& samples,
                                        const SensorCalibration& calibration) {
  const bool is_one_wheel = calibration.wheel_type == WheelType::kEncoder;
  std::vector<WheelSpeed> speeds;
  for (size_t i = 1; i < samples.size(); ++i) {
    const timestamp_t dt_ns =
        samples[i].timestamp_ns - samples[i - 1].timestamp_ns;
    const double metres_per_second =
        calibration.metres_per_tick / SecondsFromNs(dt_ns);
    const double left =
        metres_per_second * (samples[i].first - samples[i - 1].first);
    const double right =
        metres_per_second * (samples[i].second - samples[i - 1].second);
    speeds.push_back(
        {samples[i - 1].timestamp_ns + dt_ns / 2,
         is_one_wheel ? left : 0.5 * (left + right),
         is_one_wheel ? 0.0 : (right - left) / calibration.track_width_m});
  }
  return speeds;
}

// All times at which the integrand may have a kink: the ends, wheel samples and
// entries of the profile.
std::vector<timestamp_t> MergeTimes(
    const std::vector<WheelSpeed>& speeds, timestamp_t start_ns,
    timestamp_t end_ns, const std::vector<RotationAtTime>& profile) {
  std::vector<timestamp_t> times = {start_ns, end_ns};
  for (size_t i = IndexAfter(speeds, start_ns);
       i < speeds.size() && speeds[i].timestamp_ns < end_ns; ++i) {
    times.push_back(speeds[i].timestamp_ns);
  }
  for (const RotationAtTime& rotation : profile) {
    if (rotation.timestamp_ns > start_ns && rotation.timestamp_ns < end_ns) {
      times.push_back(rotation.timestamp_ns);
    }
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

// The profile's rotation at a time, along the shortest rotation between
// entries.
Eigen::Quaterniond InterpolateProfile(
    const std::vector<RotationAtTime>& profile, timestamp_t time_ns,
    size_t* cursor) {
  while (*cursor + 1 < profile.size() &&
         profile[*cursor + 1].timestamp_ns <= time_ns) {
    ++*cursor;
  }
  const RotationAtTime& a = profile[*cursor];
  if (*cursor + 1 == profile.size()) return a.start_from_body;
  const RotationAtTime& b = profile[*cursor + 1];
  const double ratio = static_cast<double>(time_ns - a.timestamp_ns) /
                       (b.timestamp_ns - a.timestamp_ns);
  return a.start_from_body *
         ExpSo3(ratio *
                LogSo3(a.start_from_body.conjugate() * b.start_from_body));
}

}  // namespace

std::vector<WheelSpeed> ComputeWheelSpeeds(
    const std::vector<WheelSample>& samples,
    const SensorCalibration& calibration) {
  if (CountsTicks(calibration.wheel_type)) {
    return SpeedsFromTicks(samples, calibration);
  }
  std::vector<WheelSpeed> speeds;
  speeds.reserve(samples.size());
  for (const WheelSample& sample : samples) {
    WheelSpeed speed;
    speed.timestamp_ns = sample.timestamp_ns;
    speed.speed = sample.first;
    if (calibration.wheel_type == WheelType::kDifferential) {
      speed.speed = 0.5 * (sample.first + sample.second);
      speed.yaw_rate =
          (sample.second - sample.first) / calibration.track_width_m;
    } else if (calibration.wheel_type == WheelType::kVelocity) {
      speed.yaw_rate = sample.second;
    } else if (calibration.wheel_type == WheelType::kSteering) {
      // The bicycle model: the vehicle turns about the point where the lines of
      // both axles meet.
      speed.yaw_rate =
          sample.first * std::tan(sample.second) / calibration.wheelbase_m;
    }
    speeds.push_back(speed);
  }
  return speeds;
}

WheelMotion PreintegrateWheel(const std::vector<WheelSpeed>& speeds,
                              timestamp_t start_ns, timestamp_t end_ns,
                              const Eigen::Quaterniond& imu_from_wheel,
                              const WheelNoise& noise,
                              const std::vector<RotationAtTime>& profile) {
  WheelMotion motion;
  motion.dt_s = SecondsFromNs(end_ns - start_ns);
  motion.covariance.setZero();
  const Eigen::Vector3d up_in_body = imu_from_wheel * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d density(noise.forward, noise.lateral, noise.vertical);
  const std::vector<timestamp_t> times =
      MergeTimes(speeds, start_ns, end_ns, profile);
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  WheelSpeed last = Interpolate(speeds, start_ns);
  size_t cursor = 0;
  for (size_t i = 1; i < times.size(); ++i) {
    const WheelSpeed next = Interpolate(speeds, times[i]);
    const double dt = SecondsFromNs(times[i] - times[i - 1]);
    const double yaw = 0.5 * (last.yaw_rate + next.yaw_rate) * dt;
    const Eigen::Quaterniond next_rotation =
        profile.empty() ? rotation * ExpSo3(yaw * up_in_body)
                        : InterpolateProfile(profile, times[i], &cursor);
    const Eigen::Matrix3d middle =
        rotation.slerp(0.5, next_rotation).toRotationMatrix();
    const double distance = 0.5 * (last.speed + next.speed) * dt;
    const double share = SecondsFromNs(times[i - 1] + times[i] - 2 * start_ns) /
                         (2.0 * motion.dt_s);
    motion.displacement_map += distance * middle;
    motion.rotation_moment += distance * share * middle;
    const Eigen::Matrix3d start_from_wheel =
        middle * imu_from_wheel.toRotationMatrix();
    motion.covariance += dt * start_from_wheel *
                         density.cwiseAbs2().asDiagonal() *
                         start_from_wheel.transpose();
    motion.distance_m += distance;
    motion.yaw_rad += yaw;
    motion.yaw_variance += dt * noise.yaw_rate * noise.yaw_rate;
    rotation = next_rotation;
    last = next;
  }
  const Eigen::Vector3d rounding =
      noise.distance_rounding *
      (rotation.slerp(0.5, Eigen::Quaterniond::Identity()) * imu_from_wheel *
       Eigen::Vector3d::UnitX());
  motion.covariance += rounding * rounding.transpose();
  motion.yaw_variance += noise.yaw_rounding * noise.yaw_rounding;
  motion.profile_rotation = rotation;
  return motion;
}

}  // namespace adasfm
