// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/check_against_vision.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "core/so3.h"
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

std::string Format(const char* format, double a, double b = 0.0,
                   double c = 0.0) {
  char buffer[256];
  std::snprintf(buffer, sizeof(buffer), format, a, b, c);
  return buffer;
}

// One way in which the calibration may be wrong.
struct Explanation {
  enum Kind { kCalibrated, kDegrees, kInverted, kAxes };
  Kind kind = kCalibrated;
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
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
  std::vector<Explanation> ListExplanations() const;
  std::string Describe(const Explanation& best, const VisionCheck& check) const;

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

std::vector<Explanation> VisionComparer::ListExplanations() const {
  std::vector<Explanation> list(3);
  list[0].map = cam_from_imu_;
  list[1].kind = Explanation::kDegrees;
  list[1].map = DegToRad(1.0) * cam_from_imu_;
  list[2].kind = Explanation::kInverted;
  list[2].map = cam_from_imu_.transpose();
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Explanation explanation;
      explanation.kind = Explanation::kAxes;
      explanation.axes.setZero();
      for (int row = 0; row < 3; ++row) {
        explanation.axes(row, order[row]) = (signs >> row) & 1 ? -1.0 : 1.0;
      }
      if (explanation.axes.isIdentity()) continue;
      explanation.map = cam_from_imu_ * explanation.axes;
      list.push_back(explanation);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  // Few changes first: they win ties.
  std::stable_sort(list.begin() + 3, list.end(),
                   [](const Explanation& a, const Explanation& b) {
                     return a.axes.trace() > b.axes.trace();
                   });
  return list;
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
      const RotationFit fit = ComputeRotationFit(data, explanation.map);
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
    return ComputeRotationFit(data, explanation->map).cost;
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
  explanation->fit =
      ComputeRotationFit(Compare(explanation->shift_s), explanation->map);
}

std::string AxesToString(const Eigen::Matrix3d& axes) {
  const char* names = "xyz";
  std::string text;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (axes(row, column) == 0.0) continue;
      if (!text.empty()) text += ", ";
      text += names[row];
      text += axes(row, column) < 0.0 ? " = -" : " = ";
      text += names[column];
    }
  }
  return text;
}

std::string VisionComparer::Describe(const Explanation& best,
                                     const VisionCheck& check) const {
  const std::string figures = Format(
      " (correlation of gyroscope and vision %.2f as calibrated, %.2f "
      "then)",
      check.total_correlation, check.shifted_correlation);
  switch (best.kind) {
    case Explanation::kCalibrated:
      return Format(
                 "images and IMU differ by %+.4f s more than "
                 "timeshift_cam_imu says: set it to %.4f or let it be "
                 "estimated",
                 best.shift_s, timeshift_s_ + best.shift_s) +
             figures;
    case Explanation::kDegrees:
      return "angular velocities look like deg/s: multiply them by pi / 180 "
             "(rad/s are expected)" +
             figures;
    case Explanation::kInverted:
      return "T_cam_imu looks inverted (it seems to be T_imu_cam): invert the "
             "matrix" +
             figures;
    case Explanation::kAxes:
      return "the IMU's axes do not fit T_cam_imu: vision fits when the log's "
             "axes are read as " +
             AxesToString(best.axes) + figures;
  }
  return "";
}

VisionCheck VisionComparer::Run() {
  VisionCheck check;
  const size_t min_num = options_.min_num_rotations;
  if (rotations_.size() < min_num) return check;
  std::vector<Explanation> explanations = ListExplanations();
  SearchShifts(&explanations);
  Explanation& calibrated = explanations[0];
  if (!std::isfinite(calibrated.fit.cost)) return check;
  RefineShift(&calibrated);

  const RotationComparison shifted = Compare(calibrated.shift_s);
  double turning = 0.0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : shifted.visual) mean += v;
  mean /= static_cast<double>(shifted.visual.size());
  for (const Eigen::Vector3d& v : shifted.visual) {
    turning += (v - mean).squaredNorm();
  }
  turning = std::sqrt(turning / shifted.visual.size());
  if (RadToDeg(turning) < options_.min_rotation_rms_deg) return check;

  check.is_conclusive = true;
  const RotationComparison as_is = Compare(0.0);
  RotationFit as_is_fit;
  if (as_is.visual.size() >= min_num) {
    check.total_correlation =
        ComputeRotationCorrelation(as_is, cam_from_imu_, &check.correlation);
    as_is_fit = ComputeRotationFit(as_is, cam_from_imu_);
  }
  // The first explanation that is clearly better than all before it.
  const Explanation* best = &calibrated;
  for (size_t i = 1; i < explanations.size(); ++i) {
    const double bar = best == &calibrated ? kClearlyBetter : kTie;
    if (explanations[i].fit.cost < bar * best->fit.cost) {
      best = &explanations[i];
    }
  }
  check.shifted_correlation =
      ComputeRotationCorrelation(Compare(best->shift_s), best->map, nullptr);
  // The offset is that of the cameras' rotation, which turns against the body.
  check.gyroscope_bias = cam_from_imu_.transpose() * calibrated.fit.rate_offset;
  if (best != &calibrated &&
      check.shifted_correlation >= options_.min_correlation) {
    check.best_axes = best->axes;
    check.is_inverted = best->kind == Explanation::kInverted;
    check.contradiction = Describe(*best, check);
    return check;
  }
  check.shifted_correlation =
      ComputeRotationCorrelation(shifted, cam_from_imu_, nullptr);
  if (check.shifted_correlation < options_.min_correlation) {
    if (check.total_correlation >= options_.min_correlation) return check;
    // Little turning and poor two-view geometries agree with nothing: that is
    // no contradiction.
    if (check.shifted_correlation > 0.5 * options_.min_correlation ||
        RadToDeg(turning) < options_.min_contradicting_rms_deg) {
      return VisionCheck();
    }
    check.contradiction = Format(
        "vision and gyroscope contradict each other (correlation %.2f, "
        "at the best time shift %.2f): check T_cam_imu, the clocks and "
        "whether log and images belong together",
        check.total_correlation, check.shifted_correlation);
    return check;
  }
  check.time_shift_correction_s = calibrated.shift_s;
  if (std::abs(calibrated.shift_s) > options_.max_accepted_shift_s &&
      calibrated.fit.cost < kTie * as_is_fit.cost) {
    check.contradiction = Describe(calibrated, check);
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
