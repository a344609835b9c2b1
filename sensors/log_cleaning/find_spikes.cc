// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/find_spikes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/median.h"

namespace adasfm {
namespace {

constexpr size_t kMinNumSamples = 50;
constexpr double kHalfWindowS = 0.05;
constexpr size_t kMinHalfWindow = 5;
// Bumps and engines in real logs of cars and phones reach 20.
constexpr double kMinRatio = 30.0;
// The deviations are measured at about this many places at most.
constexpr size_t kMaxNumMeasured = 20000;
// Samples examined on each side of a spike. Two of all these may be spikes as
// well; the third largest deviation must be within the noise, or negligible
// beside that of the spike.
constexpr size_t kNumNeighbours = 6;
constexpr size_t kNumExcused = 2;
constexpr double kQuietRatio = 8.0;
constexpr double kQuietShare = 0.02;
// The first sample of a spike is reached, and the last one left, in one step of
// at least this share of its deviation; bumps fade.
constexpr double kEdgeShare = 0.7;

class SpikeFinder {
 public:
  SpikeFinder(const std::vector<Eigen::Vector3d>& readings, double period_s)
      : readings_(readings),
        half_window_(std::max<size_t>(
            kMinHalfWindow,
            period_s > 0.0 ? std::lround(kHalfWindowS / period_s) : 0)) {}

  std::vector<bool> Run(double min_deviation);

 private:
  double Deviation(size_t index) const;
  double MeasureSigma() const;
  // Deviations of samples near a jump of more than half the threshold; those of
  // other samples are not needed, and -1.
  std::vector<double> DeviationsNearJumps(double threshold) const;
  bool HasEdges(size_t begin, size_t end) const;
  bool IsQuietAround(size_t begin, size_t end, double peak) const;

  const std::vector<Eigen::Vector3d>& readings_;
  size_t half_window_;
  double sigma_ = 0.0;  // robust, of a deviation
};

double SpikeFinder::Deviation(size_t index) const {
  const size_t begin = index < half_window_ ? 0 : index - half_window_;
  const size_t end = std::min(readings_.size(), index + half_window_ + 1);
  Eigen::Vector3d median;
  std::vector<double> values;
  for (int axis = 0; axis < 3; ++axis) {
    values.clear();
    for (size_t i = begin; i < end; ++i) values.push_back(readings_[i][axis]);
    median[axis] = UpperMedian(&values);
  }
  return (readings_[index] - median).stableNorm();
}

double SpikeFinder::MeasureSigma() const {
  const size_t step = std::max<size_t>(
      1, readings_.size() / std::max<size_t>(kMaxNumMeasured, 1));
  std::vector<double> deviations;
  for (size_t i = 0; i < readings_.size(); i += step) {
    deviations.push_back(Deviation(i));
  }
  return 1.4826 * UpperMedian(&deviations);
}

std::vector<double> SpikeFinder::DeviationsNearJumps(double threshold) const {
  std::vector<double> deviations(readings_.size(), -1.0);
  const size_t reach = half_window_ + 1;
  size_t done = 0;
  for (size_t i = 1; i < readings_.size(); ++i) {
    if ((readings_[i] - readings_[i - 1]).stableNorm() < 0.5 * threshold) {
      continue;
    }
    const size_t end = std::min(readings_.size(), i + reach);
    for (size_t j = std::max(done, i < reach ? 0 : i - reach); j < end; ++j) {
      deviations[j] = Deviation(j);
    }
    done = std::max(done, end);
  }
  return deviations;
}

bool SpikeFinder::HasEdges(size_t begin, size_t end) const {
  const auto step = [this](size_t i) {
    return (readings_[i] - readings_[i - 1]).stableNorm();
  };
  return (begin == 0 || step(begin) > kEdgeShare * Deviation(begin)) &&
         (end == readings_.size() ||
          step(end) > kEdgeShare * Deviation(end - 1));
}

bool SpikeFinder::IsQuietAround(size_t begin, size_t end, double peak) const {
  std::vector<double> around;
  for (size_t k = 1; k <= kNumNeighbours; ++k) {
    if (begin >= k) around.push_back(Deviation(begin - k));
    if (end - 1 + k < readings_.size()) {
      around.push_back(Deviation(end - 1 + k));
    }
  }
  std::sort(around.rbegin(), around.rend());
  return around.size() > kNumExcused &&
         around[kNumExcused] <
             std::max(kQuietRatio * sigma_, kQuietShare * peak);
}

std::vector<bool> SpikeFinder::Run(double min_deviation) {
  std::vector<bool> is_spike(readings_.size(), false);
  if (readings_.size() < kMinNumSamples) return is_spike;
  sigma_ = MeasureSigma();
  const double threshold = std::max(min_deviation, kMinRatio * sigma_);
  const std::vector<double> deviations = DeviationsNearJumps(threshold);
  for (size_t begin = 0; begin < readings_.size(); ++begin) {
    if (deviations[begin] < threshold) continue;
    size_t end = begin;
    double peak = 0.0;
    while (end < readings_.size() && deviations[end] >= threshold) {
      peak = std::max(peak, deviations[end++]);
    }
    // For longer runs the medians would be wrong.
    if (end - begin <= half_window_ && HasEdges(begin, end) &&
        IsQuietAround(begin, end, peak)) {
      std::fill(is_spike.begin() + begin, is_spike.begin() + end, true);
    }
    begin = end;
  }
  return is_spike;
}

}  // namespace

std::vector<bool> FindSpikes(const std::vector<Eigen::Vector3d>& readings,
                             double period_s, double min_deviation) {
  return SpikeFinder(readings, period_s).Run(min_deviation);
}

}  // namespace adasfm
