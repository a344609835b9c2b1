// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/standstill.h"

#include <algorithm>
#include <cmath>

#include "core/median.h"
#include "core/so3.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

// Half of a candidate's window, and the motion that an idling engine may add to
// the sensors' own noise.
constexpr double kHalfWindowS = 0.5;
constexpr double kIdleRate = 0.005;       // rad/s
constexpr double kIdleForce = 0.05;       // m/s^2
constexpr double kIdleRateDrift = 0.002;  // rad/s
constexpr double kIdleForceDrift = 0.03;  // m/s^2
constexpr double kMaxBias = 0.03;         // rad/s
constexpr double kIdleSpeed = 0.02;       // m/s
// What a parked machine leaves of either end of its standstill to the links.
constexpr double kStandstillEndS = 20.0;
// Largest difference between a link's mean rate and that of the others, in
// sigmas of an axis: one of 5,000 links exceeds it by chance.
constexpr double kMaxDeviation = 4.0;
// Shortest blocks whose means give the spectrum, s. Longer blocks observe
// slower motion, but are fewer. A run needs kMinNumBlocks of them.
constexpr double kShortestBlockS = 0.1;
constexpr int kMinNumBlocks = 3;
// The white noise has the weight of this many blocks, since the variance of a
// few blocks is uncertain.
constexpr double kPriorBlocks = 2.0;

using SampleIterator = std::vector<ImuSample>::const_iterator;

struct SampleMoments {
  Eigen::Vector3d mean_rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_force = Eigen::Vector3d::Zero();
  double rate_sigma = 0.0;  // of one axis
  double force_sigma = 0.0;
};

SampleMoments ComputeMoments(SampleIterator first, SampleIterator last) {
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

bool IsSeenMoving(const MotionLogs& logs, timestamp_t start_ns,
                  timestamp_t end_ns) {
  const auto& intervals = logs.seen_moving_ns;
  const auto first = std::partition_point(
      intervals.begin(), intervals.end(),
      [start_ns](const auto& interval) { return interval.second <= start_ns; });
  return first != intervals.end() && first->first < end_ns;
}

// The kind of standstill in the second around a time.
StandstillKind FindCandidate(const MotionLogs& logs, timestamp_t time_ns,
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
  // An idling engine shakes, but its means stay constant; the means of a
  // machine that creeps or rocks do not.
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

// The IMU's rate; 0 for a log that is too short.
double ImuRateHz(const MotionLogs& logs) {
  std::vector<timestamp_t> times;
  times.reserve(logs.imu.size());
  for (const ImuSample& sample : logs.imu) times.push_back(sample.timestamp_ns);
  const double period_s = ComputeMedianPeriod(times);
  return period_s > 0.0 ? 1.0 / period_s : 0.0;
}

// Rotation and duration of links, whose ratio is the mean rate.
struct RotationSum {
  Eigen::Vector3d angle = Eigen::Vector3d::Zero();  // rad
  double time_s = 0.0;

  void Add(const RotationSum& other, double sign) {
    angle += sign * other.angle;
    time_s += sign * other.time_s;
  }
};

RotationSum RotationOf(const OdometryLink& link) {
  // As logged: the bias of the preintegration, which all links share, is added
  // back.
  return {LogSo3(link.imu.delta_rotation) + link.dt_s * link.imu.bias.gyroscope,
          link.dt_s};
}

// A run of links, and the gyroscope's samples in it.
class Run {
 public:
  Run(std::vector<size_t> indices, const std::vector<timestamp_t>& times_ns,
      const std::vector<ImuSample>& imu, std::vector<OdometryLink>* links)
      : indices_(std::move(indices)),
        times_ns_(times_ns),
        imu_(imu),
        links_(*links) {}

  // Removes links that rotate.
  void Test(double density);
  // Scatter of the links' mean rates as a squared density about each axis.
  // Medians, so that links that rotate do not count.
  Eigen::Array3d ScatterOfLinks(double white) const;
  void EstimateDensity(double density, double imu_rate_hz);

 private:
  // The squared density of each axis from the means of blocks of block_size
  // samples; zero when there are too few.
  Eigen::Array3d DensityOfBlocks(int64_t block_size, double block_s,
                                 double white) const;

  std::vector<size_t> indices_;
  const std::vector<timestamp_t>& times_ns_;
  const std::vector<ImuSample>& imu_;
  std::vector<OdometryLink>& links_;
};

Eigen::Array3d Run::ScatterOfLinks(double white) const {
  // The median of a normal variable's distance from its median, in sigmas.
  constexpr double kMedianDistance = 0.6745;
  const double count = static_cast<double>(indices_.size());
  Eigen::Array3d scatter;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> rates, distances;
    for (const size_t k : indices_) {
      rates.push_back(RotationOf(links_[k]).angle[axis] / links_[k].dt_s);
    }
    std::vector<double> sorted = rates;
    const double median = UpperMedian(&sorted);
    for (size_t i = 0; i < rates.size(); ++i) {
      distances.push_back(std::abs(rates[i] - median) *
                          std::sqrt(links_[indices_[i]].dt_s));
    }
    const double sigma = UpperMedian(&distances) / kMedianDistance;
    scatter[axis] =
        (kPriorBlocks * white + count * sigma * sigma) / (kPriorBlocks + count);
  }
  return scatter.max(white);
}

void Run::Test(double density) {
  const Eigen::Array3d scatter = ScatterOfLinks(density * density).sqrt();
  RotationSum sum;
  for (const size_t k : indices_) sum.Add(RotationOf(links_[k]), 1.0);
  while (indices_.size() > 1) {
    double largest = 0.0;
    size_t worst = 0;
    for (size_t i = 0; i < indices_.size(); ++i) {
      const RotationSum own = RotationOf(links_[indices_[i]]);
      RotationSum rest = sum;
      rest.Add(own, -1.0);
      const double deviation =
          ((own.angle / own.time_s - rest.angle / rest.time_s).array().abs() /
           scatter)
              .maxCoeff() /
          std::sqrt(1.0 / own.time_s + 1.0 / rest.time_s);
      if (deviation > largest) {
        largest = deviation;
        worst = i;
      }
    }
    if (largest < kMaxDeviation) return;
    OdometryLink& link = links_[indices_[worst]];
    sum.Add(RotationOf(link), -1.0);
    link.standstill = StandstillKind::kNone;
    indices_.erase(indices_.begin() + worst);
  }
}

Eigen::Array3d Run::DensityOfBlocks(int64_t block_size, double block_s,
                                    double white) const {
  std::vector<Eigen::Array3d> means;
  // Blocks do not reach over links that were taken out.
  for (size_t i = 0; i < indices_.size();) {
    size_t last = i + 1;
    while (last < indices_.size() && indices_[last] == indices_[last - 1] + 1) {
      ++last;
    }
    auto first = FirstNotBefore(imu_, times_ns_[indices_[i]]);
    const auto end = FirstNotBefore(imu_, times_ns_[indices_[last - 1] + 1]);
    for (; end - first >= block_size; first += block_size) {
      means.push_back(
          ComputeMoments(first, first + block_size).mean_rate.array());
    }
    i = last;
  }
  const double count = static_cast<double>(means.size());
  if (count < kMinNumBlocks) return Eigen::Array3d::Zero();
  Eigen::Array3d mean = Eigen::Array3d::Zero();
  for (const Eigen::Array3d& value : means) mean += value / count;
  Eigen::Array3d sum = Eigen::Array3d::Constant(kPriorBlocks * white);
  for (const Eigen::Array3d& value : means) {
    sum += block_s * (value - mean).square();
  }
  return sum / (kPriorBlocks + count - 1.0);
}

void Run::EstimateDensity(double density, double imu_rate_hz) {
  const double white = density * density;
  Eigen::Array3d all = Eigen::Array3d::Constant(white);
  double time = 0.0;
  for (const size_t k : indices_) time += links_[k].dt_s;
  for (double block_s = kShortestBlockS; kMinNumBlocks * block_s <= time;
       block_s *= 2.0) {
    const int64_t size =
        std::max<int64_t>(1, std::llround(block_s * imu_rate_hz));
    all = all.max(DensityOfBlocks(size, size / imu_rate_hz, white));
  }
  for (const size_t k : indices_) {
    links_[k].standstill_rate_density = (all - white).sqrt().matrix();
    links_[k].standstill_time_s = time;
  }
}

}  // namespace

std::vector<std::pair<timestamp_t, timestamp_t>> FindParkedIntervals(
    const MotionLogs& logs, const ImuNoise& noise) {
  const timestamp_t step = NsFromSeconds(2.0 * kHalfWindowS);
  const timestamp_t margin = NsFromSeconds(kStandstillEndS);
  std::vector<std::pair<timestamp_t, timestamp_t>> intervals;
  const double imu_rate_hz = ImuRateHz(logs);
  if (imu_rate_hz <= 0.0) return intervals;
  const auto is_at_rest = [&](timestamp_t time_ns) {
    return (!logs.wheel.empty() ||
            !IsSeenMoving(logs, time_ns - step / 2, time_ns + step / 2)) &&
           FindCandidate(logs, time_ns, noise, imu_rate_hz) ==
               StandstillKind::kAtRest;
  };
  for (timestamp_t time = logs.StartNs(); time <= logs.EndNs(); time += step) {
    if (!is_at_rest(time)) continue;
    // Noise may make a single second look like motion.
    if (intervals.empty() || time - intervals.back().second > 2 * step) {
      intervals.emplace_back(time, time);
    }
    intervals.back().second = time;
  }
  intervals.erase(std::remove_if(intervals.begin(), intervals.end(),
                                 [margin](const auto& interval) {
                                   return interval.second - interval.first <
                                          3 * margin;
                                 }),
                  intervals.end());
  for (auto& [start_ns, end_ns] : intervals) {
    start_ns += margin;
    end_ns -= margin;
  }
  return intervals;
}

void MarkStandstills(const std::vector<timestamp_t>& times_ns,
                     const MotionLogs& logs, const ImuNoise& noise,
                     std::vector<OdometryLink>* links) {
  const double imu_rate_hz = ImuRateHz(logs);
  if (imu_rate_hz <= 0.0) return;
  std::vector<size_t> indices;
  const auto finish = [&] {
    if (indices.empty()) return;
    Run run(std::move(indices), times_ns, logs.imu, links);
    run.Test(noise.gyroscope_noise_density);
    run.EstimateDensity(noise.gyroscope_noise_density, imu_rate_hz);
    indices.clear();
  };
  for (size_t k = 0; k < links->size(); ++k) {
    OdometryLink& link = (*links)[k];
    if (link.is_parked) {
      finish();
      continue;
    }
    const bool may_stand = !logs.wheel.empty() ||
                           !IsSeenMoving(logs, times_ns[k], times_ns[k + 1]);
    if (link.has_imu && link.dt_s > 0.0 && may_stand) {
      link.standstill =
          FindCandidate(logs, times_ns[k] + (times_ns[k + 1] - times_ns[k]) / 2,
                        noise, imu_rate_hz);
    }
    if (link.standstill == StandstillKind::kNone) {
      finish();
    } else {
      indices.push_back(k);
    }
  }
  finish();
}

}  // namespace adasfm
