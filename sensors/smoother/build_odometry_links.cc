// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/build_odometry_links.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/interpolate_pose.h"
#include "core/option_checker.h"
#include "core/sensor_log.h"
#include "core/so3.h"
#include "sensors/io/log_checks.h"
#include "sensors/smoother/standstill.h"

namespace adasfm {
namespace {

// Images further apart than this belong to different recordings.
constexpr double kMaxFilledGapS = 600.0;
// Links are no longer than this: images further apart get states between.
constexpr double kMaxLinkS = 0.5;
// Logs are used from this long before the first to this long after the last
// image, since standstills there observe the biases.
constexpr double kMaxLeadS = 20.0;

template <typename Sample>
double RateHz(const std::vector<Sample>& samples) {
  std::vector<timestamp_t> times;
  times.reserve(samples.size());
  for (const Sample& sample : samples) times.push_back(sample.timestamp_ns);
  const double period = ComputeMedianPeriod(times);
  return period > 0.0 ? 1.0 / period : 0.0;
}

// The parked interval that contains the given one, if any.
const std::pair<timestamp_t, timestamp_t>* FindParked(const MotionLogs& logs,
                                                      timestamp_t start_ns,
                                                      timestamp_t end_ns) {
  const auto parked = std::find_if(
      logs.parked_ns.begin(), logs.parked_ns.end(), [&](const auto& interval) {
        return interval.first <= start_ns && end_ns <= interval.second;
      });
  return parked == logs.parked_ns.end() ? nullptr : &*parked;
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

// The same, but with no states while parked.
void AppendFilledUnlessParked(const MotionLogs& logs, timestamp_t end_ns,
                              timestamp_t max_step_ns,
                              std::vector<timestamp_t>* times) {
  for (const auto& [begin_parked_ns, end_parked_ns] : logs.parked_ns) {
    if (end_parked_ns <= times->back() || end_ns <= begin_parked_ns) continue;
    AppendFilled(begin_parked_ns, max_step_ns, times);
    times->push_back(std::min(end_parked_ns, end_ns));
  }
  AppendFilled(end_ns, max_step_ns, times);
}

// A trajectory's motion over one link: a displacement that does not depend on
// the state (its map has rank one, along the forward direction), and a
// rotation.
WheelMotion ComputeOdometryMotion(const std::vector<OdometryPose>& poses,
                                  timestamp_t start_ns, timestamp_t end_ns,
                                  const SensorCalibration& calibration,
                                  double period_s) {
  constexpr double kAnyGap = std::numeric_limits<double>::infinity();
  const Rigid3d first = InterpolatePose(poses, start_ns, kAnyGap).value();
  const Rigid3d second = InterpolatePose(poses, end_ns, kAnyGap).value();
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
    // Rounding is uniform over a tick: variance q^2 / 12 at both ends.
    const double wheel = calibration.metres_per_tick / std::sqrt(6.0);
    noise.distance_rounding = wheel / std::sqrt(2.0);
    noise.yaw_rounding = std::sqrt(2.0) * wheel / calibration.track_width_m;
  }
  if (calibration.wheel_type == WheelType::kEncoder) {
    noise.distance_rounding = calibration.metres_per_tick / std::sqrt(6.0);
  }
  noise.lateral = options.lateral_speed_noise;
  noise.vertical = options.vertical_speed_noise;
  return noise;
}

}  // namespace

bool OdometryLinkOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmPriors", error)
      .Positive({{"max_imu_gap_s", max_imu_gap_s},
                 {"max_wheel_gap_s", max_wheel_gap_s},
                 {"lateral_speed_noise_m_s_sqrt_hz", lateral_speed_noise},
                 {"vertical_speed_noise_m_s_sqrt_hz", vertical_speed_noise}})
      .AllHold();
}

OdometryTimeline BuildTimeline(const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs) {
  const timestamp_t max_step = NsFromSeconds(kMaxLinkS);
  const timestamp_t lead = NsFromSeconds(kMaxLeadS);
  OdometryTimeline timeline;
  std::vector<timestamp_t>& times = timeline.times_ns;
  times.push_back(std::max(logs.StartNs(), times_ns.front() - lead));
  for (const timestamp_t time : times_ns) {
    AppendFilledUnlessParked(logs, time, max_step, &times);
    timeline.indices.push_back(times.size() - 1);
  }
  AppendFilledUnlessParked(logs, std::min(logs.EndNs(), times_ns.back() + lead),
                           max_step, &times);
  return timeline;
}

std::vector<OdometryLink> BuildOdometryLinks(
    const std::vector<timestamp_t>& times_ns, const MotionLogs& logs,
    const SensorCalibration& calibration, const ImuBias& bias,
    const OdometryLinkOptions& options) {
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
    const auto* parked = FindParked(logs, start, end);
    if (parked) {
      link.standstill = StandstillKind::kAtRest;
      link.standstill_time_s = SecondsFromNs(parked->second - parked->first);
      link.is_parked = true;
      link.has_wheel = !logs.wheel.empty() || !logs.odometry.empty();
      continue;
    }
    if (link.dt_s > kMaxFilledGapS) continue;
    profile.clear();
    if (CoversInterval(logs.imu, start, end, options.max_imu_gap_s)) {
      link.has_imu = true;
      link.imu = PreintegrateImu(logs.imu, start, end, bias,
                                 calibration.imu_noise, &profile);
      link.rate_change = InterpolateImu(logs.imu, end).angular_velocity -
                         InterpolateImu(logs.imu, start).angular_velocity;
    }
    if (CoversInterval(logs.odometry, start, end, options.max_wheel_gap_s)) {
      link.has_wheel = true;
      link.wheel = ComputeOdometryMotion(logs.odometry, start, end, calibration,
                                         odometry_period);
    } else if (CoversInterval(logs.wheel, start, end,
                              options.max_wheel_gap_s)) {
      link.has_wheel = true;
      link.has_wheel_yaw = ObservesYaw(calibration.wheel_type);
      link.wheel = PreintegrateWheel(logs.wheel, start, end,
                                     calibration.imu_from_wheel.rotation,
                                     wheel_noise, profile);
    }
  }
  MarkStandstills(times_ns, logs, calibration.imu_noise, &links);
  return links;
}

}  // namespace adasfm
