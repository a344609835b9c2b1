// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/build_odometry_links.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

// Images further apart than this belong to different recordings.
constexpr double kMaxFilledGapS = 600.0;
// A standstill: half the window, and what an idling engine may add to the
// sensors' own noise.
constexpr double kHalfWindowS = 0.5;
constexpr double kIdleRate = 0.005;       // rad/s
constexpr double kIdleForce = 0.05;       // m/s^2
constexpr double kIdleRateDrift = 0.002;  // rad/s
constexpr double kIdleForceDrift = 0.03;  // m/s^2
constexpr double kMaxBias = 0.03;         // rad/s
constexpr double kIdleSpeed = 0.02;       // m/s

timestamp_t NsFromSeconds(double seconds) {
  return std::llround(1e9 * seconds);
}

template <typename Sample>
typename std::vector<Sample>::const_iterator FirstNotBefore(
    const std::vector<Sample>& samples, timestamp_t time_ns) {
  return std::lower_bound(samples.begin(), samples.end(), time_ns,
                          [](const Sample& sample, timestamp_t time) {
                            return sample.timestamp_ns < time;
                          });
}

template <typename Sample>
double RateHz(const std::vector<Sample>& samples) {
  std::vector<timestamp_t> times;
  times.reserve(samples.size());
  for (const Sample& sample : samples) times.push_back(sample.timestamp_ns);
  const double period = ComputeMedianPeriod(times);
  return period > 0.0 ? 1.0 / period : 0.0;
}

// Appends the end and, before it, states so that no step exceeds max_step_ns.
void AppendFilled(timestamp_t end_ns, timestamp_t max_step_ns,
                  std::vector<timestamp_t>* times) {
  const timestamp_t start_ns = times->back();
  const timestamp_t length = end_ns - start_ns;
  if (length <= 0) return;
  if (length <= NsFromSeconds(kMaxFilledGapS)) {
    const timestamp_t num_steps = (length + max_step_ns - 1) / max_step_ns;
    for (timestamp_t i = 1; i < num_steps; ++i) {
      times->push_back(start_ns + length * i / num_steps);
    }
  }
  times->push_back(end_ns);
}

struct SampleMoments {
  Eigen::Vector3d mean_rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_force = Eigen::Vector3d::Zero();
  double rate_sigma = 0.0;  // of one axis
  double force_sigma = 0.0;
};

SampleMoments ComputeMoments(std::vector<ImuSample>::const_iterator first,
                             std::vector<ImuSample>::const_iterator last) {
  SampleMoments moments;
  const double count = std::max<double>(1.0, last - first);
  for (auto it = first; it != last; ++it) {
    moments.mean_rate += it->angular_velocity / count;
    moments.mean_force += it->specific_force / count;
  }
  double rate_sum = 0.0, force_sum = 0.0;
  for (auto it = first; it != last; ++it) {
    rate_sum += (it->angular_velocity - moments.mean_rate).squaredNorm();
    force_sum += (it->specific_force - moments.mean_force).squaredNorm();
  }
  moments.rate_sigma = std::sqrt(rate_sum / (3.0 * count));
  moments.force_sigma = std::sqrt(force_sum / (3.0 * count));
  return moments;
}

bool WheelsStandStill(const std::vector<WheelSpeed>& speeds,
                      timestamp_t start_ns, timestamp_t end_ns) {
  bool any = false;
  for (auto it = FirstNotBefore(speeds, start_ns);
       it != speeds.end() && it->timestamp_ns <= end_ns; ++it) {
    if (std::abs(it->speed) > kIdleSpeed) return false;
    any = true;
  }
  return any;
}

// The pose of a trajectory at a time within it.
Rigid3d InterpolatePose(const std::vector<OdometryPose>& poses,
                        timestamp_t time_ns) {
  auto next = FirstNotBefore(poses, time_ns);
  if (next->timestamp_ns == time_ns) return next->world_from_body;
  const OdometryPose& a = *(next - 1);
  const OdometryPose& b = *next;
  const double ratio = static_cast<double>(time_ns - a.timestamp_ns) /
                       (b.timestamp_ns - a.timestamp_ns);
  const Rigid3d& pose_a = a.world_from_body;
  const Rigid3d& pose_b = b.world_from_body;
  return Rigid3d(
      pose_a.rotation.slerp(ratio, pose_b.rotation),
      pose_a.translation + ratio * (pose_b.translation - pose_a.translation));
}

bool CoversInterval(const std::vector<OdometryPose>& poses,
                    timestamp_t start_ns, timestamp_t end_ns,
                    double max_gap_s) {
  if (poses.empty() || start_ns < poses.front().timestamp_ns ||
      end_ns > poses.back().timestamp_ns) {
    return false;
  }
  auto it = FirstNotBefore(poses, start_ns);
  if (it == poses.begin()) ++it;
  for (; it != poses.end() && (it - 1)->timestamp_ns < end_ns; ++it) {
    const timestamp_t gap = it->timestamp_ns - (it - 1)->timestamp_ns;
    if (SecondsFromNs(gap) > max_gap_s) return false;
  }
  return true;
}

// A trajectory's motion over one link: a displacement that does not depend on
// the state (its map has rank one, along the forward direction), and a turn.
WheelMotion ComputeOdometryMotion(const std::vector<OdometryPose>& poses,
                                  timestamp_t start_ns, timestamp_t end_ns,
                                  const SensorCalibration& calibration,
                                  double period_s) {
  const Rigid3d first = InterpolatePose(poses, start_ns);
  const Rigid3d second = InterpolatePose(poses, end_ns);
  const Rigid3d first_from_second = first.Inverse() * second;
  const Eigen::Quaterniond& imu_from_wheel =
      calibration.imu_from_wheel.rotation;
  const Eigen::Vector3d step = imu_from_wheel * first_from_second.translation;
  WheelMotion motion;
  motion.dt_s = SecondsFromNs(end_ns - start_ns);
  motion.displacement_map =
      step * (imu_from_wheel * Eigen::Vector3d::UnitX()).transpose();
  motion.has_rotation = true;
  motion.rotation =
      imu_from_wheel * first_from_second.rotation * imu_from_wheel.conjugate();
  motion.profile_rotation = motion.rotation;
  motion.distance_m = step.norm();
  const double time = std::max(motion.dt_s, 1e-6) * period_s;
  motion.covariance = calibration.wheel_speed_noise *
                      calibration.wheel_speed_noise * time *
                      Eigen::Matrix3d::Identity();
  motion.rotation_covariance = calibration.wheel_yaw_rate_noise *
                               calibration.wheel_yaw_rate_noise * time *
                               Eigen::Matrix3d::Identity();
  return motion;
}

// Densities of the speeds' noise from that of one sample at the log's rate.
WheelNoise ComputeWheelNoise(const SensorCalibration& calibration,
                             double rate_hz,
                             const OdometryLinkOptions& options) {
  const double root_period = rate_hz > 0.0 ? std::sqrt(1.0 / rate_hz) : 0.1;
  const double speed = calibration.wheel_speed_noise * root_period;
  const bool has_two_wheels =
      calibration.wheel_type == WheelType::kDifferential ||
      calibration.wheel_type == WheelType::kTicks;
  WheelNoise noise;
  // The mean and the difference of two wheels.
  noise.forward = has_two_wheels ? speed / std::sqrt(2.0) : speed;
  noise.yaw_rate = has_two_wheels
                       ? std::sqrt(2.0) * speed / calibration.track_width_m
                       : calibration.wheel_yaw_rate_noise * root_period;
  if (calibration.wheel_type == WheelType::kTicks) {
    // Each count is off by up to a tick, evenly: q^2 / 12 at both ends.
    const double wheel = calibration.metres_per_tick / std::sqrt(6.0);
    noise.distance_rounding = wheel / std::sqrt(2.0);
    noise.yaw_rounding = std::sqrt(2.0) * wheel / calibration.track_width_m;
  }
  noise.lateral = options.lateral_speed_noise;
  noise.vertical = options.vertical_speed_noise;
  return noise;
}

}  // namespace

timestamp_t MotionLogs::StartNs() const {
  if (!imu.empty()) return imu.front().timestamp_ns;
  return wheel.empty() ? odometry.front().timestamp_ns
                       : wheel.front().timestamp_ns;
}

timestamp_t MotionLogs::EndNs() const {
  if (!imu.empty()) return imu.back().timestamp_ns;
  return wheel.empty() ? odometry.back().timestamp_ns
                       : wheel.back().timestamp_ns;
}

OdometryTimeline BuildTimeline(const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs,
                               const OdometryLinkOptions& options) {
  const timestamp_t max_step = NsFromSeconds(options.max_link_s);
  const timestamp_t lead = NsFromSeconds(options.max_lead_s);
  OdometryTimeline timeline;
  std::vector<timestamp_t>& times = timeline.times_ns;
  times.push_back(std::max(logs.StartNs(), times_ns.front() - lead));
  for (const timestamp_t time : times_ns) {
    AppendFilled(time, max_step, &times);
    timeline.indices.push_back(times.size() - 1);
  }
  AppendFilled(std::min(logs.EndNs(), times_ns.back() + lead), max_step,
               &times);
  return timeline;
}

StandstillKind FindStandstill(const MotionLogs& logs, timestamp_t time_ns,
                              const ImuNoise& noise, double imu_rate_hz) {
  const timestamp_t half = NsFromSeconds(kHalfWindowS);
  const timestamp_t start = time_ns - half, end = time_ns + half;
  const auto first = FirstNotBefore(logs.imu, start);
  const auto last = FirstNotBefore(logs.imu, end);
  // Half a window is enough at the log's ends.
  if ((last - first) < kHalfWindowS * imu_rate_hz) return StandstillKind::kNone;
  const bool has_wheel = !logs.wheel.empty();
  if (has_wheel && !WheelsStandStill(logs.wheel, start, end)) {
    return StandstillKind::kNone;
  }
  const SampleMoments all = ComputeMoments(first, last);
  // An idling engine shakes, but its means stay; those of a machine that
  // creeps or rocks do not.
  const auto middle = first + (last - first) / 2;
  const SampleMoments head = ComputeMoments(first, middle);
  const SampleMoments tail = ComputeMoments(middle, last);
  const double root_rate = std::sqrt(imu_rate_hz);
  const double root_half = 3.0 * std::sqrt(2.0 / kHalfWindowS);
  const bool turns =
      all.mean_rate.norm() > kMaxBias ||
      (head.mean_rate - tail.mean_rate).norm() >
          kIdleRateDrift + root_half * noise.gyroscope_noise_density ||
      all.rate_sigma >
          kIdleRate + 1.5 * noise.gyroscope_noise_density * root_rate;
  const bool moves =
      (head.mean_force - tail.mean_force).norm() >
          kIdleForceDrift + root_half * noise.accelerometer_noise_density ||
      all.force_sigma >
          kIdleForce + 1.5 * noise.accelerometer_noise_density * root_rate;
  if (turns) return StandstillKind::kNone;
  if (!moves) return StandstillKind::kAtRest;
  // Wheels that do not turn keep the heading even when the machine rocks.
  return has_wheel ? StandstillKind::kNoTurn : StandstillKind::kNone;
}

std::vector<OdometryLink> BuildOdometryLinks(
    const std::vector<timestamp_t>& times_ns, const MotionLogs& logs,
    const SensorCalibration& calibration, const ImuBias& bias,
    const OdometryLinkOptions& options) {
  const double imu_rate_hz = RateHz(logs.imu);
  const double odometry_rate_hz = RateHz(logs.odometry);
  const double odometry_period =
      odometry_rate_hz > 0.0 ? 1.0 / odometry_rate_hz : 0.0;
  const WheelNoise wheel_noise =
      ComputeWheelNoise(calibration, RateHz(logs.wheel), options);
  std::vector<OdometryLink> links(times_ns.empty() ? 0 : times_ns.size() - 1);
  std::vector<RotationAtTime> profile;
  for (size_t k = 0; k < links.size(); ++k) {
    const timestamp_t start = times_ns[k], end = times_ns[k + 1];
    OdometryLink& link = links[k];
    link.dt_s = SecondsFromNs(end - start);
    profile.clear();
    if (CoversInterval(logs.imu, start, end, options.max_imu_gap_s)) {
      link.has_imu = true;
      link.imu = PreintegrateImu(logs.imu, start, end, bias,
                                 calibration.imu_noise, &profile);
      link.standstill = FindStandstill(logs, (start + end) / 2,
                                       calibration.imu_noise, imu_rate_hz);
    }
    if (CoversInterval(logs.odometry, start, end, options.max_wheel_gap_s)) {
      link.has_wheel = true;
      link.wheel = ComputeOdometryMotion(logs.odometry, start, end, calibration,
                                         odometry_period);
    } else if (CoversInterval(logs.wheel, start, end,
                              options.max_wheel_gap_s)) {
      link.has_wheel = true;
      link.has_wheel_yaw = calibration.wheel_type != WheelType::kSpeed;
      link.wheel = PreintegrateWheel(logs.wheel, start, end,
                                     calibration.imu_from_wheel.rotation,
                                     wheel_noise, profile);
    }
  }
  return links;
}

}  // namespace adasfm
