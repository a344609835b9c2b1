// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/check_against_vision.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "sensors/calibration_mistakes.h"
#include "sensors/rotation_comparison.h"
#include "sensors/shift_search.h"

namespace adasfm {
namespace {

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

class VisionComparer {
 public:
  VisionComparer(const std::vector<TimedRotation>& rotations,
                 const std::vector<ImuSample>& imu,
                 const SensorCalibration& calibration,
                 const VisionCheckOptions& options)
      : search_(rotations, imu, calibration.timeshift_cam_imu_s, options),
        cam_from_imu_(calibration.cam_from_imu.rotation.toRotationMatrix()),
        timeshift_s_(calibration.timeshift_cam_imu_s),
        options_(options) {}

  VisionCheck Run();

 private:
  // The first of the best explanations that beat the calibrated one.
  const Explanation* FindBetter(
      const std::vector<Explanation>& explanations) const;

  ShiftSearch search_;
  Eigen::Matrix3d cam_from_imu_;
  double timeshift_s_;
  VisionCheckOptions options_;
};

const Explanation* VisionComparer::FindBetter(
    const std::vector<Explanation>& explanations) const {
  const Explanation* best = &explanations[0];
  for (size_t i = 1; i < explanations.size(); ++i) {
    const Explanation& other = explanations[i];
    const double bar = best == &explanations[0] ? kClearlyBetter : kTie;
    if (other.fit.cost >= bar * best->fit.cost) continue;
    if (search_.Evidence(explanations[0], other) < kMinEvidence) continue;
    best = &other;
  }
  return best;
}

VisionCheck VisionComparer::Run() {
  // 1. Every explanation at its best time shift.
  const size_t min_num = options_.min_num_rotations;
  if (search_.num_rotations() < min_num) return VisionCheck();
  std::vector<Explanation> explanations;
  for (const CalibrationMistake& mistake :
       ListCalibrationMistakes(cam_from_imu_)) {
    explanations.push_back({mistake, 0.0, RotationFit()});
  }
  search_.SearchShifts(&explanations);
  Explanation& calibrated = explanations[0];
  if (!std::isfinite(calibrated.fit.cost)) return VisionCheck();
  search_.RefineShift(&calibrated);
  const RotationComparison shifted = search_.Compare(calibrated.shift_s);
  const double turning_deg = ComputeTurningDeg(shifted);
  if (turning_deg < options_.min_rotation_rms_deg) return VisionCheck();

  // 2. How well the calibration fits as it is.
  VisionCheck check;
  check.is_conclusive = true;
  Explanation as_is = calibrated;
  const RotationComparison unshifted = search_.Compare(0.0);
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
      search_.Compare(best->shift_s), best->mistake.map, nullptr);
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
    none.fit =
        ComputeRotationFit(search_.Compare(as_is.shift_s), none.mistake.map);
    if (turning_deg < options_.min_contradicting_rms_deg ||
        search_.Evidence(as_is, none) < kMinEvidence) {
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
                         search_.Evidence(as_is, calibrated) >= kMinEvidence;
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
