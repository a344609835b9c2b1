// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/check_against_vision.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "core/so3.h"
#include "sensors/calibration_mistakes.h"
#include "sensors/rotation_comparison.h"

namespace adasfm {
namespace {

// Only rotations over short times: the gyroscope's drift and the order of
// turns do not matter there.
constexpr double kMaxIntervalS = 1.0;
constexpr double kMaxAngleRad = 1.0;
// That many suffice; more would only take time.
constexpr size_t kMaxNumRotations = 500;
constexpr double kCoarseStepS = 0.02;
// Another explanation must fit this much better than the calibration, and one
// listed later this much better than one listed earlier.
constexpr double kClearlyBetter = 0.7;
constexpr double kTie = 0.9;
// A refusal needs evidence. The best of some 10,000 wrong explanations (50 at
// 200 shifts) is by chance e^9 times likelier than the right one; twice that.
constexpr double kMinEvidence = 20.0;

std::string Format(const char* format, double a, double b) {
  char buffer[256];
  std::snprintf(buffer, sizeof(buffer), format, a, b);
  return buffer;
}

std::string Figures(const VisionCheck& check) {
  return Format(
      " (correlation of gyroscope and vision %.2f as calibrated, %.2f then)",
      check.total_correlation, check.shifted_correlation);
}

// A mistake (or none) at its best time shift.
struct Explanation {
  CalibrationMistake mistake;
  double shift_s = 0.0;
  RotationFit fit;
};

class VisionComparer {
 public:
  VisionComparer(const std::vector<TimedRotation>& rotations,
                 const std::vector<ImuSample>& imu,
                 const SensorCalibration& calibration,
                 const VisionCheckOptions& options)
      : integral_(imu),
        cam_from_imu_(calibration.cam_from_imu.rotation.toRotationMatrix()),
        timeshift_s_(calibration.timeshift_cam_imu_s),
        options_(options) {
    SelectRotations(rotations);
  }

  VisionCheck Run();

 private:
  void SelectRotations(const std::vector<TimedRotation>& rotations);
  RotationComparison Compare(double shift_s) const {
    return Compare(rotations_, shift_s);
  }
  RotationComparison Compare(const std::vector<TimedRotation>& rotations,
                             double shift_s) const;
  // The best shift on a coarse grid for every explanation.
  void SearchShifts(std::vector<Explanation>* explanations) const;
  void RefineShift(Explanation* explanation) const;
  // See ComputeEvidence; over the intervals that the log covers at both
  // time shifts.
  double Evidence(const Explanation& worse, const Explanation& better) const;
  // The first of the best explanations that beat the calibrated one.
  const Explanation* FindBetter(
      const std::vector<Explanation>& explanations) const;
  static double TurningDeg(const RotationComparison& data);

  RateIntegral integral_;
  Eigen::Matrix3d cam_from_imu_;
  double timeshift_s_;
  VisionCheckOptions options_;
  std::vector<TimedRotation> rotations_;
  // The shortest intervals only, for the exact time shift.
  std::vector<TimedRotation> short_rotations_;
};

void VisionComparer::SelectRotations(
    const std::vector<TimedRotation>& rotations) {
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
  for (const TimedRotation& rotation : usable) {
    // Up to two frames: the tenth part of the lengths is one frame's, however
    // far the matching reached.
    const timestamp_t max_length = lengths[lengths.size() / 10] * 5 / 2;
    if (rotation.end_ns - rotation.start_ns <= max_length &&
        short_rotations_.size() < kMaxNumRotations) {
      short_rotations_.push_back(rotation);
    }
  }
}

RotationComparison VisionComparer::Compare(
    const std::vector<TimedRotation>& rotations, double shift_s) const {
  const timestamp_t shift = std::llround(1e9 * (timeshift_s_ + shift_s));
  RotationComparison data;
  for (const TimedRotation& rotation : rotations) {
    const timestamp_t start = rotation.start_ns + shift;
    const timestamp_t end = rotation.end_ns + shift;
    if (!integral_.Covers(start) || !integral_.Covers(end)) continue;
    data.visual.push_back(LogSo3(rotation.cam2_from_cam1));
    // cam2_from_cam1 turns against the body's motion.
    data.gyro.push_back(integral_.At(start) - integral_.At(end));
    data.dt_s.push_back(SecondsFromNs(end - start));
  }
  return data;
}

void VisionComparer::SearchShifts(
    std::vector<Explanation>* explanations) const {
  const int num_steps =
      static_cast<int>(std::ceil(options_.max_time_shift_s / kCoarseStepS));
  const size_t min_num =
      std::max<size_t>(options_.min_num_rotations, rotations_.size() / 2);
  // From no shift outwards: the nearest of equals wins.
  for (int step = 0; step <= 2 * num_steps; ++step) {
    const int magnitude = (step + 1) / 2;
    const double shift =
        kCoarseStepS * (step % 2 == 1 ? magnitude : -magnitude);
    const RotationComparison data = Compare(shift);
    if (data.visual.size() < min_num) continue;
    for (Explanation& explanation : *explanations) {
      const RotationFit fit = ComputeRotationFit(data, explanation.mistake.map);
      if (fit.cost < explanation.fit.cost) {
        explanation.fit = fit;
        explanation.shift_s = shift;
      }
    }
  }
}

// Golden section about the coarse minimum. What the model leaves out (a
// slightly turned T_cam_imu) grows with the interval and pulls on the shift, so
// short intervals decide where there are enough of them.
void VisionComparer::RefineShift(Explanation* explanation) const {
  constexpr double kRatio = 0.6180339887498949;
  double low = explanation->shift_s - kCoarseStepS;
  double high = explanation->shift_s + kCoarseStepS;
  const bool has_short =
      short_rotations_.size() >= 2 * options_.min_num_rotations;
  const auto cost = [&](double shift) {
    const RotationComparison data =
        Compare(has_short ? short_rotations_ : rotations_, shift);
    return ComputeRotationFit(data, explanation->mistake.map).cost;
  };
  double a = high - kRatio * (high - low), b = low + kRatio * (high - low);
  double cost_a = cost(a), cost_b = cost(b);
  while (high - low > 1e-4) {
    if (cost_a < cost_b) {
      high = b;
      b = a;
      cost_b = cost_a;
      a = high - kRatio * (high - low);
      cost_a = cost(a);
    } else {
      low = a;
      a = b;
      cost_a = cost_b;
      b = low + kRatio * (high - low);
      cost_b = cost(b);
    }
  }
  explanation->shift_s = 0.5 * (low + high);
  explanation->fit = ComputeRotationFit(Compare(explanation->shift_s),
                                        explanation->mistake.map);
}

double VisionComparer::Evidence(const Explanation& worse,
                                const Explanation& better) const {
  RotationComparison worse_data, better_data;
  timestamp_t end_ns = rotations_.front().start_ns;
  double covered_s = 0.0, sum_s = 0.0;
  for (const TimedRotation& rotation : rotations_) {
    const RotationComparison a = Compare({rotation}, worse.shift_s);
    const RotationComparison b = Compare({rotation}, better.shift_s);
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

double VisionComparer::TurningDeg(const RotationComparison& data) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : data.visual) mean += v;
  mean /= static_cast<double>(data.visual.size());
  double sum = 0.0;
  for (const Eigen::Vector3d& v : data.visual) sum += (v - mean).squaredNorm();
  return RadToDeg(std::sqrt(sum / data.visual.size()));
}

const Explanation* VisionComparer::FindBetter(
    const std::vector<Explanation>& explanations) const {
  const Explanation* best = &explanations[0];
  for (size_t i = 1; i < explanations.size(); ++i) {
    const Explanation& other = explanations[i];
    const double bar = best == &explanations[0] ? kClearlyBetter : kTie;
    if (other.fit.cost >= bar * best->fit.cost) continue;
    if (Evidence(explanations[0], other) < kMinEvidence) continue;
    best = &other;
  }
  return best;
}

VisionCheck VisionComparer::Run() {
  // 1. Every explanation at its best time shift.
  const size_t min_num = options_.min_num_rotations;
  if (rotations_.size() < min_num) return VisionCheck();
  std::vector<Explanation> explanations;
  for (const CalibrationMistake& mistake :
       ListCalibrationMistakes(cam_from_imu_)) {
    explanations.push_back({mistake, 0.0, RotationFit()});
  }
  SearchShifts(&explanations);
  Explanation& calibrated = explanations[0];
  if (!std::isfinite(calibrated.fit.cost)) return VisionCheck();
  RefineShift(&calibrated);
  const RotationComparison shifted = Compare(calibrated.shift_s);
  const double turning_deg = TurningDeg(shifted);
  if (turning_deg < options_.min_rotation_rms_deg) return VisionCheck();

  // 2. How well the calibration fits as it is.
  VisionCheck check;
  check.is_conclusive = true;
  Explanation as_is = calibrated;
  const RotationComparison unshifted = Compare(0.0);
  const bool has_unshifted = unshifted.visual.size() >= min_num;
  if (has_unshifted) {
    as_is.shift_s = 0.0;
    as_is.fit = ComputeRotationFit(unshifted, cam_from_imu_);
    check.total_correlation = ComputeRotationCorrelation(
        unshifted, cam_from_imu_, &check.correlation);
  }
  // The offset is that of the cameras' rotation, which turns against the body.
  check.gyroscope_bias = cam_from_imu_.transpose() * calibrated.fit.rate_offset;

  // 3. A mistake that explains vision better.
  const Explanation* best = FindBetter(explanations);
  check.shifted_correlation = ComputeRotationCorrelation(
      Compare(best->shift_s), best->mistake.map, nullptr);
  if (best != &calibrated &&
      check.shifted_correlation >= options_.min_correlation) {
    check.best_axes = best->mistake.axes;
    check.is_inverted = best->mistake.kind == CalibrationMistake::kInverted;
    check.contradiction = DescribeMistake(best->mistake) + Figures(check);
    return check;
  }
  check.shifted_correlation =
      ComputeRotationCorrelation(shifted, cam_from_imu_, nullptr);
  if (check.shifted_correlation < options_.min_correlation &&
      check.total_correlation < options_.min_correlation) {
    // 4. Nothing fits: is the gyroscope worse than none?
    Explanation none = as_is;
    none.mistake.map.setZero();
    none.fit = ComputeRotationFit(Compare(as_is.shift_s), none.mistake.map);
    if (turning_deg < options_.min_contradicting_rms_deg ||
        Evidence(as_is, none) < kMinEvidence) {
      return VisionCheck();
    }
    check.contradiction =
        "vision and gyroscope contradict each other: check T_cam_imu, the "
        "clocks and whether log and images belong together" +
        Figures(check);
    return check;
  }
  if (check.shifted_correlation < options_.min_correlation) return check;

  // 5. The time shift.
  check.time_shift_correction_s = calibrated.shift_s;
  const bool is_better = calibrated.fit.cost < kTie * as_is.fit.cost &&
                         Evidence(as_is, calibrated) >= kMinEvidence;
  if (std::abs(calibrated.shift_s) > options_.max_accepted_shift_s &&
      (is_better || !has_unshifted)) {
    check.contradiction =
        Format(
            "images and IMU differ by %+.4f s more than timeshift_cam_imu "
            "says: set it to %.4f or let it be estimated",
            calibrated.shift_s, timeshift_s_ + calibrated.shift_s) +
        Figures(check);
    check.contradiction_is_time_shift = true;
  }
  return check;
}

}  // namespace

bool VisionCheckOptions::IsValid(std::string* error) const {
  if (max_time_shift_s > 0.0 && min_rotation_rms_deg > 0.0 &&
      min_contradicting_rms_deg > 0.0 && min_num_rotations > 1 &&
      min_correlation > 0.0 && min_correlation < 1.0 &&
      max_accepted_shift_s > 0.0) {
    return true;
  }
  *error =
      "AdaSfmVisionCheck: every option must be positive and "
      "min_correlation below 1";
  return false;
}

VisionCheck CheckAgainstVision(const std::vector<TimedRotation>& rotations,
                               const std::vector<ImuSample>& imu,
                               const SensorCalibration& calibration,
                               const VisionCheckOptions& options) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  if (imu.size() < 2) return VisionCheck();
  return VisionComparer(rotations, imu, calibration, options).Run();
}

}  // namespace adasfm
