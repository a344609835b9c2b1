// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/preintegration/imu_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/types.h"

namespace adasfm {
namespace {

constexpr double kStretchS = 1.0;
constexpr size_t kMinNumStretches = 8;
// The share of the stretches that is quieter.
constexpr double kQuietShare = 0.25;
// Stated figures are kept within this factor: estimates err by some percent.
constexpr double kMinFactor = 1.2;

// The quantile of the quiet share of a chi-square of n degrees of freedom over
// n (Wilson and Hilferty).
double QuietQuantile(double n) {
  constexpr double kNormalQuantile = -0.6745;
  const double spread = 2.0 / (9.0 * n);
  return std::pow(1.0 - spread + kNormalQuantile * std::sqrt(spread), 3);
}

// Squared density of one quantity, from second differences of the means over
// blocks of samples; negative when the log is too short.
template <typename Value>
double QuietDensity2(const std::vector<ImuSample>& samples, size_t block,
                     const Value& value) {
  const double period_s = SecondsFromNs(samples.back().timestamp_ns -
                                        samples.front().timestamp_ns) /
                          (samples.size() - 1.0);
  const size_t num_triples = static_cast<size_t>(
      kStretchS / (3.0 * static_cast<double>(block) * period_s));
  if (num_triples == 0) return -1.0;
  const auto mean = [&](size_t first) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (size_t i = first; i < first + block; ++i) sum += value(samples[i]);
    return Eigen::Vector3d(sum / static_cast<double>(block));
  };
  std::vector<double> variances;
  const size_t stretch = 3 * block * num_triples;
  for (size_t start = 0; start + stretch <= samples.size(); start += stretch) {
    double sum = 0.0;
    for (size_t i = start; i < start + stretch; i += 3 * block) {
      sum +=
          (mean(i) - 2.0 * mean(i + block) + mean(i + 2 * block)).squaredNorm();
    }
    // The difference of white noise has six times the variance of a mean.
    variances.push_back(sum / (6.0 * 3.0 * num_triples));
  }
  if (variances.size() < kMinNumStretches) return -1.0;
  const auto quiet =
      variances.begin() + static_cast<int64_t>(kQuietShare * variances.size());
  std::nth_element(variances.begin(), quiet, variances.end());
  return *quiet / QuietQuantile(3.0 * num_triples) *
         static_cast<double>(block) * period_s;
}

template <typename Value>
double Raise(const std::vector<ImuSample>& samples, double stated,
             const Value& value) {
  double least = std::numeric_limits<double>::infinity();
  for (const size_t block : {1, 4, 16}) {
    least = std::min(least, QuietDensity2(samples, block, value));
  }
  if (!(least > kMinFactor * kMinFactor * stated * stated)) return stated;
  return std::sqrt(least);
}

}  // namespace

ImuNoise RaiseToLog(const std::vector<ImuSample>& samples,
                    const ImuNoise& stated) {
  ImuNoise noise = stated;
  if (samples.size() < 2) return noise;
  noise.gyroscope_noise_density =
      Raise(samples, stated.gyroscope_noise_density,
            [](const ImuSample& sample) { return sample.angular_velocity; });
  noise.accelerometer_noise_density =
      Raise(samples, stated.accelerometer_noise_density,
            [](const ImuSample& sample) { return sample.specific_force; });
  return noise;
}

}  // namespace adasfm
