// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/shift_search.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

// Only rotations over short times: the gyroscope's drift does not matter there.
constexpr double kMaxIntervalS = 1.0;
constexpr double kMaxAngleRad = 1.0;
// That many suffice; more would only take time.
constexpr size_t kMaxNumRotations = 500;
// Time shifts up to this are tried, relative to the calibration's.
constexpr double kMaxTimeShiftS = 2.0;
constexpr double kCoarseStepS = 0.02;
constexpr double kMaxLagS = 0.1;

// The argument of the least value between two bounds, by golden sections.
template <typename Function>
double Minimize(double low, double high, double tolerance,
                const Function& function) {
  constexpr double kRatio = 0.6180339887498949;
  double a = high - kRatio * (high - low), b = low + kRatio * (high - low);
  double value_a = function(a), value_b = function(b);
  while (high - low > tolerance) {
    if (value_a < value_b) {
      high = b;
      b = a;
      value_b = value_a;
      a = high - kRatio * (high - low);
      value_a = function(a);
    } else {
      low = a;
      a = b;
      value_a = value_b;
      b = low + kRatio * (high - low);
      value_b = function(b);
    }
  }
  return 0.5 * (low + high);
}

}  // namespace

void ShiftSearch::SelectRotations(const std::vector<TimedRotation>& rotations) {
  std::vector<TimedRotation> usable;
  for (const TimedRotation& rotation : rotations) {
    const double dt = SecondsFromNs(rotation.end_ns - rotation.start_ns);
    if (dt <= 0.0 || dt > kMaxIntervalS) continue;
    if (LogSo3(rotation.cam2_from_cam1).norm() > kMaxAngleRad) continue;
    usable.push_back(rotation);
  }
  std::stable_sort(usable.begin(), usable.end(),
                   [](const TimedRotation& a, const TimedRotation& b) {
                     return a.start_ns < b.start_ns;
                   });
  const size_t stride = usable.size() / kMaxNumRotations + 1;
  for (size_t i = 0; i < usable.size(); i += stride) {
    rotations_.push_back(usable[i]);
  }
  std::vector<timestamp_t> lengths;
  for (const TimedRotation& rotation : usable) {
    lengths.push_back(rotation.end_ns - rotation.start_ns);
  }
  std::sort(lengths.begin(), lengths.end());
  if (lengths.empty()) return;
  // The 10 % quantile of the lengths is one frame, however far the matching
  // reached.
  const timestamp_t frame_ns = lengths[lengths.size() / 10];
  for (const TimedRotation& rotation : usable) {
    const timestamp_t length = rotation.end_ns - rotation.start_ns;
    const auto add_up_to = [&](timestamp_t max_length_ns,
                               std::vector<TimedRotation>* list) {
      if (length > max_length_ns || list->size() >= kMaxNumRotations) return;
      list->push_back(rotation);
    };
    add_up_to(frame_ns * 5 / 2, &short_rotations_);
    add_up_to(frame_ns * 3 / 2, &frame_rotations_);
  }
  const size_t min_num = 2 * kMinNumRotations;
  if (short_rotations_.size() < min_num) short_rotations_ = rotations_;
  if (frame_rotations_.size() < min_num) frame_rotations_ = short_rotations_;
}

bool ShiftSearch::IsCovered(const TimedRotation& rotation,
                            timestamp_t shift_ns) const {
  return integral_.Covers(rotation.start_ns + shift_ns) &&
         integral_.Covers(rotation.end_ns + shift_ns);
}

size_t ShiftSearch::CountCovered(double shift_s) const {
  const timestamp_t shift_ns = NsFromSeconds(timeshift_s_ + shift_s);
  return std::count_if(rotations_.begin(), rotations_.end(),
                       [&](const TimedRotation& rotation) {
                         return IsCovered(rotation, shift_ns);
                       });
}

RotationComparison ShiftSearch::Compare(
    const std::vector<TimedRotation>& rotations, double shift_s,
    double lag_s) const {
  const timestamp_t shift = NsFromSeconds(timeshift_s_ + shift_s);
  const auto turn = [&](timestamp_t start, timestamp_t end) -> Eigen::Vector3d {
    const Eigen::Vector3d without_lag = integral_.Turn(start, end);
    if (lag_s == 0.0) return without_lag;
    return without_lag +
           lag_s * (integral_.MeanRate(end) - integral_.MeanRate(start));
  };
  RotationComparison data;
  for (const TimedRotation& rotation : rotations) {
    if (!IsCovered(rotation, shift)) continue;
    const timestamp_t start = rotation.start_ns + shift;
    const timestamp_t end = rotation.end_ns + shift;
    data.visual.push_back(LogSo3(rotation.cam2_from_cam1));
    // cam2_from_cam1 rotates opposite to the body.
    data.gyro.push_back(-turn(start, end));
    data.start_s.push_back(SecondsFromNs(start));
    data.dt_s.push_back(SecondsFromNs(end - start));
  }
  return data;
}

void ShiftSearch::SearchShifts(std::vector<Explanation>* explanations) const {
  const int num_steps =
      static_cast<int>(std::ceil(kMaxTimeShiftS / kCoarseStepS));
  const auto shift_at = [](int step) {
    const int magnitude = (step + 1) / 2;
    return kCoarseStepS * (step % 2 == 1 ? magnitude : -magnitude);
  };
  // A shift must not win because the log covers fewer rotations there. The log
  // may cover only a part of the images.
  size_t max_num = 0;
  for (int step = 0; step <= 2 * num_steps; ++step) {
    max_num = std::max(max_num, CountCovered(shift_at(step)));
  }
  const size_t min_num = std::max(kMinNumRotations, max_num / 2);
  // From no shift outwards: of equal costs the shift nearest to zero wins.
  for (int step = 0; step <= 2 * num_steps; ++step) {
    const RotationComparison data = Compare(shift_at(step));
    if (data.visual.size() < min_num) continue;
    for (Explanation& explanation : *explanations) {
      const RotationFit fit = ComputeRotationFit(data, explanation.mistake.map);
      if (fit.cost < explanation.fit.cost) {
        explanation.fit = fit;
        explanation.shift_s = shift_at(step);
      }
    }
  }
}

double ShiftSearch::FindShift(const Explanation& explanation,
                              const std::vector<TimedRotation>& rotations,
                              double* cost) const {
  const auto cost_at = [&](double shift) {
    return ComputeRotationFit(Compare(rotations, shift, explanation.lag_s),
                              explanation.mistake.map)
        .cost;
  };
  const double shift_s =
      Minimize(explanation.shift_s - kCoarseStepS,
               explanation.shift_s + kCoarseStepS, 1e-4, cost_at);
  *cost = cost_at(shift_s);
  return shift_s;
}

void ShiftSearch::RefineShift(const std::vector<TimedRotation>& rotations,
                              Explanation* explanation) const {
  double cost;
  explanation->shift_s = FindShift(*explanation, rotations, &cost);
  explanation->fit = ComputeRotationFit(
      Compare(rotations_, explanation->shift_s, explanation->lag_s),
      explanation->mistake.map);
}

void ShiftSearch::RefineShift(Explanation* explanation) const {
  RefineShift(short_rotations_, explanation);
}

void ShiftSearch::RefineShiftOfOneFrame(Explanation* explanation) const {
  RefineShift(frame_rotations_, explanation);
}

void ShiftSearch::RefineLag(Explanation* explanation) const {
  // A larger lag needs a smaller shift.
  const auto with_lag = [&](double lag_s) {
    Explanation other = *explanation;
    other.lag_s = lag_s;
    other.shift_s -= lag_s;
    return other;
  };
  const double lag_s = Minimize(0.0, kMaxLagS, 1e-3, [&](double lag) {
    double cost;
    FindShift(with_lag(lag), short_rotations_, &cost);
    return cost;
  });
  *explanation = with_lag(lag_s);
  RefineShift(explanation);
}

double ShiftSearch::Evidence(const Explanation& worse,
                             const Explanation& better) const {
  RotationComparison worse_data, better_data;
  timestamp_t end_ns = rotations_.front().start_ns;
  double covered_s = 0.0, sum_s = 0.0;
  for (const TimedRotation& rotation : rotations_) {
    const RotationComparison a =
        Compare({rotation}, worse.shift_s, worse.lag_s);
    const RotationComparison b =
        Compare({rotation}, better.shift_s, better.lag_s);
    if (a.visual.empty() || b.visual.empty()) continue;
    worse_data.Append(a);
    better_data.Append(b);
    sum_s += SecondsFromNs(rotation.end_ns - rotation.start_ns);
    const timestamp_t new_ns = std::max(end_ns, rotation.end_ns);
    covered_s += SecondsFromNs(new_ns - std::max(end_ns, rotation.start_ns));
    end_ns = new_ns;
  }
  if (covered_s <= 0.0) return 0.0;
  return ComputeEvidence(ComputeRateDistances(worse_data, worse.mistake.map,
                                              worse.fit.rate_offset),
                         ComputeRateDistances(better_data, better.mistake.map,
                                              better.fit.rate_offset),
                         sum_s / covered_s);
}

double ComputeTurningDeg(const RotationComparison& data) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : data.visual) mean += v;
  mean /= static_cast<double>(data.visual.size());
  double sum = 0.0;
  for (const Eigen::Vector3d& v : data.visual) sum += (v - mean).squaredNorm();
  return RadToDeg(std::sqrt(sum / data.visual.size()));
}

}  // namespace adasfm
