// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bridged_holes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/so3.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

constexpr double kHolePeriods = 1.5;
constexpr size_t kMinNumSamples = 100;
// Approximate number of stretches that measure the error of a bridge.
constexpr size_t kNumStretches = 1000;

// Readings of one sensor at a nearly constant rate.
struct ReadingLog {
  std::vector<timestamp_t> times_ns;
  std::vector<Eigen::Vector3d> readings;
  double period_s = 0.0;
};

// The error of a bridge's mean, rms of an axis, by the hole's length in
// periods.
class BridgeError {
 public:
  explicit BridgeError(const ReadingLog& log) : log_(log) {}

  double Sigma(double hole_s) {
    const size_t num_steps =
        std::max<size_t>(2, std::lround(hole_s / log_.period_s));
    const auto known = sigmas_.find(num_steps);
    if (known != sigmas_.end()) return known->second;
    return sigmas_[num_steps] = Measure(num_steps);
  }

 private:
  double Measure(size_t num_steps) const;

  const ReadingLog& log_;
  std::map<size_t, double> sigmas_;
};

double BridgeError::Measure(size_t num_steps) const {
  const std::vector<Eigen::Vector3d>& readings = log_.readings;
  if (readings.size() < kMinNumSamples || num_steps >= readings.size()) {
    return 0.0;
  }
  const size_t step = std::max<size_t>(1, readings.size() / kNumStretches);
  double sum = 0.0;
  size_t count = 0;
  for (size_t begin = 0; begin + num_steps < readings.size(); begin += step) {
    const size_t end = begin + num_steps;
    const double length_s =
        SecondsFromNs(log_.times_ns[end] - log_.times_ns[begin]);
    if (length_s > (num_steps + 0.5) * log_.period_s) continue;  // has a hole
    // The trapezoidal mean of all samples less that of both ends.
    Eigen::Vector3d mean = 0.5 * (readings[begin] + readings[end]);
    const Eigen::Vector3d bridge = mean;
    for (size_t i = begin + 1; i < end; ++i) mean += readings[i];
    sum += (mean / num_steps - bridge).squaredNorm() / 3.0;
    ++count;
  }
  return count == 0 ? 0.0 : std::sqrt(sum / count);
}

template <typename Sample, typename Reading>
ReadingLog ToReadings(const std::vector<Sample>& samples, Reading reading) {
  ReadingLog log;
  for (const Sample& sample : samples) {
    log.times_ns.push_back(sample.timestamp_ns);
    log.readings.push_back(reading(sample));
  }
  log.period_s = ComputeMedianPeriod(log.times_ns);
  return log;
}

// Calls add(link, hole's share of the link [s], rest of the link after it [s],
// whole hole [s]) for each link that a hole reaches into.
template <typename Add>
void ForHoles(const ReadingLog& log, const std::vector<timestamp_t>& times_ns,
              Add add) {
  if (log.period_s <= 0.0) return;
  for (size_t i = 1; i < log.times_ns.size(); ++i) {
    const timestamp_t begin = log.times_ns[i - 1], end = log.times_ns[i];
    const double hole_s = SecondsFromNs(end - begin);
    if (hole_s <= kHolePeriods * log.period_s) continue;
    size_t link = std::upper_bound(times_ns.begin(), times_ns.end(), begin) -
                  times_ns.begin();
    link = link == 0 ? 0 : link - 1;
    for (; link + 1 < times_ns.size() && times_ns[link] < end; ++link) {
      const timestamp_t from = std::max(begin, times_ns[link]);
      const timestamp_t to = std::min(end, times_ns[link + 1]);
      if (to <= from) continue;
      add(link, SecondsFromNs(to - from),
          SecondsFromNs(times_ns[link + 1] - to), hole_s);
    }
  }
}

// e_R of the hole, in the frame at the link's end, is as large on all axes. The
// velocity errs by its own error and by the mean force, rotated by e_R, over
// the rest of the link; the position by the velocity's error.
void AddToImu(double rotation_sigma, double velocity_sigma, double rest_s,
              ImuPreintegration* imu) {
  const Eigen::Matrix3d start_from_end = imu->delta_rotation.toRotationMatrix();
  const Eigen::Matrix3d velocity_by_rotation =
      -Hat(imu->delta_velocity / std::max(imu->dt_s, 1e-6)) * start_from_end *
      rest_s;
  Eigen::Matrix<double, 9, 6> map = Eigen::Matrix<double, 9, 6>::Zero();
  map.block<3, 3>(0, 0).setIdentity();
  map.block<3, 3>(3, 0) = velocity_by_rotation;
  map.block<3, 3>(3, 3).setIdentity();
  map.block<3, 3>(6, 0) = 0.5 * rest_s * velocity_by_rotation;
  map.block<3, 3>(6, 3) = rest_s * Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 6, 1> variance;
  variance.head<3>().setConstant(rotation_sigma * rotation_sigma);
  variance.tail<3>().setConstant(velocity_sigma * velocity_sigma);
  imu->covariance += map * variance.asDiagonal() * map.transpose();
}

void AddImuHoles(const std::vector<ImuSample>& samples,
                 const std::vector<timestamp_t>& times_ns,
                 std::vector<OdometryLink>* links) {
  const ReadingLog rates = ToReadings(
      samples, [](const ImuSample& sample) { return sample.angular_velocity; });
  const ReadingLog forces = ToReadings(
      samples, [](const ImuSample& sample) { return sample.specific_force; });
  BridgeError rate_error(rates), force_error(forces);
  ForHoles(rates, times_ns,
           [&](size_t k, double length_s, double rest_s, double hole_s) {
             OdometryLink& link = (*links)[k];
             if (!link.has_imu) return;
             AddToImu(length_s * rate_error.Sigma(hole_s),
                      length_s * force_error.Sigma(hole_s), rest_s, &link.imu);
           });
}

void AddWheelHoles(const std::vector<WheelSpeed>& speeds,
                   const std::vector<timestamp_t>& times_ns,
                   const Eigen::Vector3d& forward,
                   std::vector<OdometryLink>* links) {
  const ReadingLog log = ToReadings(speeds, [](const WheelSpeed& speed) {
    // Sigma averages over three axes, of which two are zero here.
    return Eigen::Vector3d(std::sqrt(3.0) * speed.speed, 0.0, 0.0);
  });
  const ReadingLog turns = ToReadings(speeds, [](const WheelSpeed& speed) {
    return Eigen::Vector3d(std::sqrt(3.0) * speed.yaw_rate, 0.0, 0.0);
  });
  BridgeError speed_error(log), turn_error(turns);
  ForHoles(log, times_ns,
           [&](size_t k, double length_s, double, double hole_s) {
             OdometryLink& link = (*links)[k];
             if (!link.has_wheel) return;
             const Eigen::Vector3d step =
                 length_s * speed_error.Sigma(hole_s) * forward;
             link.wheel.covariance += step * step.transpose();
             const double turn = length_s * turn_error.Sigma(hole_s);
             link.wheel.yaw_variance += turn * turn;
           });
}

}  // namespace

void AddHoleUncertainty(const MotionLogs& logs,
                        const std::vector<timestamp_t>& times_ns,
                        const Eigen::Quaterniond& imu_from_wheel,
                        std::vector<OdometryLink>* links) {
  AddImuHoles(logs.imu, times_ns, links);
  AddWheelHoles(logs.wheel, times_ns, imu_from_wheel * Eigen::Vector3d::UnitX(),
                links);
}

}  // namespace adasfm
