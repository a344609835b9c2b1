// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// One IMU reading in the body (IMU) frame: angular velocity in rad/s, specific
// force in m/s^2 (+9.81 upwards at rest).
struct ImuSample {
  timestamp_t timestamp_ns = 0;
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();
};

// What the two columns of a wheel log mean (docs/reference/formats.md).
enum class WheelType {
  kDifferential,  // left speed, right speed [m/s]
  kVelocity,      // forward speed [m/s], yaw rate [rad/s]
  kSpeed,         // forward speed [m/s], unused
  kTicks,         // left counter, right counter
  kEncoder,       // counter of one wheel, unused
  kSteering,      // speed of the rear axle [m/s], steering angle [rad]
  kOdometry,      // a trajectory of poses instead of samples
};

// The speed or counter of a single wheel does not observe the yaw.
inline bool ObservesYaw(WheelType type) {
  return type != WheelType::kSpeed && type != WheelType::kEncoder;
}

inline bool CountsTicks(WheelType type) {
  return type == WheelType::kTicks || type == WheelType::kEncoder;
}

struct WheelSample {
  timestamp_t timestamp_ns = 0;
  double first = 0.0;
  double second = 0.0;
};

// One pose of a TUM odometry trajectory.
struct OdometryPose {
  timestamp_t timestamp_ns = 0;
  Rigid3d world_from_body;
};

struct ImageTime {
  timestamp_t timestamp_ns = 0;
  std::string name;
};

// The first of the samples, sorted by timestamp_ns, at time_ns or later; the
// end of the samples when there is none.
template <typename Sample>
typename std::vector<Sample>::const_iterator FirstNotBefore(
    const std::vector<Sample>& samples, timestamp_t time_ns) {
  return std::lower_bound(samples.begin(), samples.end(), time_ns,
                          [](const Sample& sample, timestamp_t time) {
                            return sample.timestamp_ns < time;
                          });
}

// The index of the first of the samples after time_ns; their number when there
// is none.
template <typename Sample>
size_t IndexAfter(const std::vector<Sample>& samples, timestamp_t time_ns) {
  return std::upper_bound(samples.begin(), samples.end(), time_ns,
                          [](timestamp_t time, const Sample& sample) {
                            return time < sample.timestamp_ns;
                          }) -
         samples.begin();
}

// Whether the samples (in order of time) cover [start, end] without a gap
// longer than max_gap_s.
template <typename Sample>
bool CoversInterval(const std::vector<Sample>& samples, timestamp_t start_ns,
                    timestamp_t end_ns, double max_gap_s) {
  if (samples.empty() || start_ns > end_ns ||
      start_ns < samples.front().timestamp_ns ||
      end_ns > samples.back().timestamp_ns) {
    return false;
  }
  for (size_t i = std::max<size_t>(IndexAfter(samples, start_ns), 1);
       i < samples.size() && samples[i - 1].timestamp_ns < end_ns; ++i) {
    const timestamp_t gap =
        samples[i].timestamp_ns - samples[i - 1].timestamp_ns;
    if (SecondsFromNs(gap) > max_gap_s) return false;
  }
  return true;
}

// White noise densities and bias random walks, continuous time.
struct ImuNoise {
  double gyroscope_noise_density = 1e-3;      // rad/s/sqrt(Hz)
  double gyroscope_random_walk = 2e-5;        // rad/s^2/sqrt(Hz)
  double accelerometer_noise_density = 2e-2;  // m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 5e-4;    // m/s^3/sqrt(Hz)
};

}  // namespace adasfm
