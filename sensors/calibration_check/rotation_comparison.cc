// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/rotation_comparison.h"

#include <algorithm>
#include <cmath>

#include "core/median.h"
#include "core/so3.h"

namespace adasfm {

RateIntegral::RateIntegral(const std::vector<ImuSample>& imu) : imu_(imu) {
  integral_.resize(imu.size(), Eigen::Vector3d::Zero());
  first_from_body_.resize(imu.size(), Eigen::Quaterniond::Identity());
  for (size_t i = 1; i < imu.size(); ++i) {
    const double dt =
        SecondsFromNs(imu[i].timestamp_ns - imu[i - 1].timestamp_ns);
    const Eigen::Vector3d step =
        0.5 * dt * (imu[i - 1].angular_velocity + imu[i].angular_velocity);
    integral_[i] = integral_[i - 1] + step;
    first_from_body_[i] = (first_from_body_[i - 1] * ExpSo3(step)).normalized();
  }
}

bool RateIntegral::Covers(timestamp_t time_ns) const {
  return time_ns >= imu_.front().timestamp_ns &&
         time_ns <= imu_.back().timestamp_ns;
}

size_t RateIntegral::Sample(timestamp_t time_ns) const {
  const auto next = std::upper_bound(imu_.begin(), imu_.end(), time_ns,
                                     [](timestamp_t time, const ImuSample& s) {
                                       return time < s.timestamp_ns;
                                     });
  return next - imu_.begin() - 1;
}

Eigen::Vector3d RateIntegral::Rest(size_t sample, timestamp_t time_ns) const {
  if (sample + 1 == imu_.size()) return Eigen::Vector3d::Zero();
  const ImuSample& a = imu_[sample];
  const ImuSample& b = imu_[sample + 1];
  const double dt = SecondsFromNs(time_ns - a.timestamp_ns);
  const double ratio = dt / SecondsFromNs(b.timestamp_ns - a.timestamp_ns);
  return dt * (a.angular_velocity +
               0.5 * ratio * (b.angular_velocity - a.angular_velocity));
}

Eigen::Vector3d RateIntegral::At(timestamp_t time_ns) const {
  const size_t sample = Sample(time_ns);
  return integral_[sample] + Rest(sample, time_ns);
}

Eigen::Quaterniond RateIntegral::FirstFromBody(timestamp_t time_ns) const {
  const size_t sample = Sample(time_ns);
  return first_from_body_[sample] * ExpSo3(Rest(sample, time_ns));
}

Eigen::Vector3d RateIntegral::Turn(timestamp_t start_ns,
                                   timestamp_t end_ns) const {
  return LogSo3(FirstFromBody(start_ns).conjugate() * FirstFromBody(end_ns));
}

Eigen::Vector3d RateIntegral::MeanRate(timestamp_t time_ns) const {
  constexpr timestamp_t kHalfWidthNs = 10'000'000;
  const timestamp_t start =
      std::max(time_ns - kHalfWidthNs, imu_.front().timestamp_ns);
  const timestamp_t end =
      std::min(time_ns + kHalfWidthNs, imu_.back().timestamp_ns);
  if (end <= start) return Eigen::Vector3d::Zero();
  return (At(end) - At(start)) / SecondsFromNs(end - start);
}

void RotationComparison::Append(const RotationComparison& other) {
  visual.insert(visual.end(), other.visual.begin(), other.visual.end());
  gyro.insert(gyro.end(), other.gyro.begin(), other.gyro.end());
  start_s.insert(start_s.end(), other.start_s.begin(), other.start_s.end());
  dt_s.insert(dt_s.end(), other.dt_s.begin(), other.dt_s.end());
}

RotationFit ComputeRotationFit(const RotationComparison& data,
                               const Eigen::Matrix3d& map) {
  RotationFit fit;
  const size_t num = data.visual.size();
  std::vector<double> rates(num);
  std::vector<Eigen::Vector3d> differences(num);
  for (size_t i = 0; i < num; ++i) {
    differences[i] = data.visual[i] - map * data.gyro[i];
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < num; ++i) {
      rates[i] = differences[i][axis] / data.dt_s[i];
    }
    fit.rate_offset[axis] = UpperMedian(&rates);
  }
  double sum = 0.0;
  for (const double distance :
       ComputeRateDistances(data, map, fit.rate_offset)) {
    sum += distance;
  }
  fit.cost = sum / std::max<size_t>(1, num);
  return fit;
}

std::vector<double> ComputeRateDistances(const RotationComparison& data,
                                         const Eigen::Matrix3d& map,
                                         const Eigen::Vector3d& rate_offset) {
  std::vector<double> distances(data.visual.size());
  for (size_t i = 0; i < distances.size(); ++i) {
    const Eigen::Vector3d difference = data.visual[i] - map * data.gyro[i];
    distances[i] = (difference / data.dt_s[i] - rate_offset).norm();
  }
  return distances;
}

double ComputeEvidence(const std::vector<double>& worse,
                       const std::vector<double>& better, double num_repeats) {
  if (worse.empty()) return 0.0;
  std::vector<double> sorted = worse;
  // The median of a three-dimensional normal vector's length.
  const double sigma = UpperMedian(&sorted) / kMedianNorm3;
  if (sigma <= 0.0) return 0.0;
  constexpr double kFreedom = 3.0;
  double sum = 0.0;
  for (size_t i = 0; i < worse.size(); ++i) {
    const double a = worse[i] / sigma, b = better[i] / sigma;
    sum += std::log1p(a * a / kFreedom) - std::log1p(b * b / kFreedom);
  }
  return 0.5 * (kFreedom + 3.0) * sum / std::max(1.0, num_repeats);
}

double ComputeRotationCorrelation(const RotationComparison& data,
                                  const Eigen::Matrix3d& map) {
  Eigen::Vector3d mean_visual = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_gyro = Eigen::Vector3d::Zero();
  const double num = static_cast<double>(data.visual.size());
  for (size_t i = 0; i < data.visual.size(); ++i) {
    mean_visual += data.visual[i] / num;
    mean_gyro += map * data.gyro[i] / num;
  }
  double both = 0.0, visual = 0.0, gyro = 0.0;
  for (size_t i = 0; i < data.visual.size(); ++i) {
    const Eigen::Vector3d a = data.visual[i] - mean_visual;
    const Eigen::Vector3d b = map * data.gyro[i] - mean_gyro;
    both += a.dot(b);
    visual += a.squaredNorm();
    gyro += b.squaredNorm();
  }
  constexpr double kTiny = 1e-24;
  return both / (std::sqrt(visual * gyro) + kTiny);
}

}  // namespace adasfm
