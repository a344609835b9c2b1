// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/check_against_vision.h"

#include <cmath>

#include "sensors/calibration_check/calibration_mistakes.h"
#include "sensors/calibration_check/rotation_comparison.h"
#include "sensors/calibration_check/shift_search.h"
#include "sensors/calibration_check/unexplained_rotation.h"
#include "sensors/calibration_check/visual_bias.h"
#include "sensors/io/format_figures.h"

namespace adasfm {
namespace {

// Cost ratios below which another explanation beats the calibration, and a
// later explanation an earlier one.
constexpr double kClearlyBetter = 0.7;
constexpr double kTie = 0.9;
// Ratios of the cameras' to the gyroscope's rotation that are tried. A poor
// focal length explains ratios nearer to 1.
constexpr double kTurnScales[] = {0.1, 0.125, 0.167, 0.2,  0.25, 0.33,
                                  0.4, 0.5,   0.6,   0.67, 1.5,  1.75,
                                  2.0, 2.5,   3.0,   4.0,  5.0,  8.0};
// Below this the cameras hardly rotate and the check is not conclusive.
constexpr double kMinRotationRmsDeg = 0.15;
// Cameras that rotate this much and fit no explanation contradict the
// gyroscope; smaller rotations may be the noise of two-view geometries.
constexpr double kMinContradictingRmsDeg = 1.0;
// A time shift up to this may be a clock offset and may be corrected without
// asking: exposure, readout and the driver's delay add up to tens of
// milliseconds. For larger shifts another mistake is likelier.
constexpr double kMaxCorrectedShiftS = 0.15;
// Smaller shifts are not corrected: a filter in the gyroscope is as likely a
// cause (of three KITTI drives on one clock, two seem to be off by 4 and 9 ms).
constexpr double kMinCorrectedShiftS = 0.01;
// Least unexplained share of the rotation for which gyroscope and pictures are
// taken to show different motions.
constexpr double kMaxUnexplainedRatio = 0.5;
// Largest error of vision itself in that case, as a share of what is
// unexplained.
constexpr double kMaxVisualErrorRatio = 0.33;

std::string Figures(const VisionCheck& check) {
  return FormatFigures(
      " (correlation of gyroscope and vision %.2f as calibrated, %.2f then)",
      check.total_correlation, check.shifted_correlation);
}

class VisionComparer {
 public:
  VisionComparer(const std::vector<TimedRotation>& rotations,
                 const std::vector<ImuSample>& imu,
                 const SensorCalibration& calibration)
      : rotations_(rotations),
        search_(rotations, imu, calibration.timeshift_cam_imu_s),
        cam_from_imu_(calibration.cam_from_imu.rotation.toRotationMatrix()),
        timeshift_s_(calibration.timeshift_cam_imu_s),
        gyroscope_noise_density_(
            calibration.imu_noise.gyroscope_noise_density) {}

  // The steps are numbered in the definition.
  VisionCheck Run();

 private:
  bool FindBestShifts();
  void CompareAsIs(VisionCheck* check);
  // Whether there is a mistake.
  bool NameMistake(VisionCheck* check) const;
  // Whether there is another motion.
  bool FindOtherMotion(VisionCheck* check) const;
  bool IsWorseThanNone() const;
  void CheckTurnScale(VisionCheck* check) const;
  void CheckTimeShift(VisionCheck* check) const;
  GyroscopeFilter FindFilter();
  // The best explanation that beats the calibrated one, of nearly equal ones
  // the first; else the calibrated one.
  const Explanation* FindBetter() const;
  const Explanation& calibrated() const { return explanations_[0]; }

  const std::vector<TimedRotation>& rotations_;
  ShiftSearch search_;
  Eigen::Matrix3d cam_from_imu_;
  double timeshift_s_;
  double gyroscope_noise_density_;
  // Each at its best time shift; the first one is the calibrated one.
  std::vector<Explanation> explanations_;
  double turning_deg_ = 0.0;
  // The calibrated explanation, without a time shift where the log covers that.
  Explanation as_is_;
  bool has_unshifted_ = false;
};

bool VisionComparer::FindBestShifts() {
  if (search_.num_rotations() < kMinNumRotations) return false;
  for (const CalibrationMistake& mistake :
       ListCalibrationMistakes(cam_from_imu_)) {
    Explanation explanation;
    explanation.mistake = mistake;
    explanations_.push_back(explanation);
  }
  search_.SearchShifts(&explanations_);
  if (!std::isfinite(calibrated().fit.cost)) return false;
  search_.RefineShift(&explanations_[0]);
  turning_deg_ = ComputeTurningDeg(search_.Compare(calibrated().shift_s));
  return turning_deg_ >= kMinRotationRmsDeg;
}

void VisionComparer::CompareAsIs(VisionCheck* check) {
  check->is_conclusive = true;
  as_is_ = calibrated();
  const RotationComparison unshifted = search_.Compare(0.0);
  has_unshifted_ = unshifted.visual.size() >= kMinNumRotations;
  if (has_unshifted_) {
    as_is_.shift_s = 0.0;
    as_is_.fit = ComputeRotationFit(unshifted, cam_from_imu_);
    check->total_correlation =
        ComputeRotationCorrelation(unshifted, cam_from_imu_);
  }
  // The rate is that of cam2_from_cam1, which rotates opposite to the body.
  const VisualBias bias =
      EstimateVisualBias(search_.Compare(calibrated().shift_s), cam_from_imu_);
  check->gyroscope_bias = cam_from_imu_.transpose() * bias.rate;
  check->gyroscope_bias_sigma = bias.sigma;
}

const Explanation* VisionComparer::FindBetter() const {
  const Explanation* best = &calibrated();
  for (size_t i = 1; i < explanations_.size(); ++i) {
    const Explanation& other = explanations_[i];
    const double bar = best == &calibrated() ? kClearlyBetter : kTie;
    if (other.fit.cost >= bar * best->fit.cost) continue;
    if (search_.Evidence(calibrated(), other) < kMinEvidence) continue;
    best = &other;
  }
  return best;
}

bool VisionComparer::NameMistake(VisionCheck* check) const {
  const Explanation* best = FindBetter();
  check->shifted_correlation = ComputeRotationCorrelation(
      search_.Compare(best->shift_s), best->mistake.map);
  if (best != &calibrated() &&
      check->shifted_correlation >= kMinAgreeingCorrelation) {
    check->contradiction = DescribeMistake(best->mistake) + Figures(*check);
    return true;
  }
  check->shifted_correlation = ComputeRotationCorrelation(
      search_.Compare(calibrated().shift_s), cam_from_imu_);
  return false;
}

bool VisionComparer::FindOtherMotion(VisionCheck* check) const {
  const UnexplainedRotation found = FindUnexplainedRotation(
      rotations_, search_, calibrated().shift_s, gyroscope_noise_density_);
  check->unexplained = found;
  if (!found.is_conclusive || found.turning_deg < kMinRotationRmsDeg ||
      found.residual_deg < kMaxUnexplainedRatio * found.turning_deg ||
      // A wrong scale is a mistake of its own, which CheckTurnScale names.
      found.scaled_residual_deg <
          kMaxUnexplainedRatio * found.visual_turning_deg ||
      found.visual_error_deg > kMaxVisualErrorRatio * found.residual_deg) {
    return false;
  }
  check->contradiction_is_motion = true;
  check->contradiction = FormatFigures(
      "gyroscope and pictures show different motions: of %.2f deg from photo "
      "to photo %.2f are left at the best time offset and extrinsic rotation",
      found.turning_deg, found.residual_deg);
  return true;
}

bool VisionComparer::IsWorseThanNone() const {
  Explanation none = as_is_;
  none.mistake.map.setZero();
  none.fit =
      ComputeRotationFit(search_.Compare(as_is_.shift_s), none.mistake.map);
  return turning_deg_ >= kMinContradictingRmsDeg &&
         search_.Evidence(as_is_, none) >= kMinEvidence;
}

// Scales are also tried without a time shift: on a short drive rotations of a
// wrong scale fit better at a wrong time shift.
void VisionComparer::CheckTurnScale(VisionCheck* check) const {
  Explanation best = calibrated();
  double best_scale = 1.0;
  for (const Explanation* unscaled : {&calibrated(), &as_is_}) {
    const RotationComparison shifted = search_.Compare(unscaled->shift_s);
    for (const double scale : kTurnScales) {
      Explanation scaled = *unscaled;
      scaled.mistake.map *= scale;
      scaled.fit = ComputeRotationFit(shifted, scaled.mistake.map);
      if (scaled.fit.cost >= best.fit.cost) continue;
      best = scaled;
      best_scale = scale;
    }
  }
  if (best_scale == 1.0 ||
      best.fit.cost > kClearlyBetter * calibrated().fit.cost ||
      search_.Evidence(calibrated(), best) < kMinEvidence) {
    return;
  }
  check->shifted_correlation = ComputeRotationCorrelation(
      search_.Compare(best.shift_s), best.mistake.map);
  check->contradiction =
      FormatFigures(
          "the gyroscope turns %.2g times as much as the cameras: check the "
          "unit and range of its driver, and the focal length",
          1.0 / best_scale) +
      Figures(*check);
}

void VisionComparer::CheckTimeShift(VisionCheck* check) const {
  check->time_shift_correction_s = calibrated().shift_s;
  const bool is_better = calibrated().fit.cost < kTie * as_is_.fit.cost &&
                         search_.Evidence(as_is_, calibrated()) >= kMinEvidence;
  check->is_clock_shift =
      is_better && has_unshifted_ &&
      std::abs(calibrated().shift_s) >= kMinCorrectedShiftS &&
      std::abs(calibrated().shift_s) <= kMaxCorrectedShiftS;
  if (std::abs(calibrated().shift_s) > kMaxAcceptedShiftS &&
      (is_better || !has_unshifted_)) {
    check->contradiction =
        FormatFigures(
            "images and IMU differ by %+.4f s more than timeshift_cam_imu "
            "says: set it to %.4f or let it be estimated",
            calibrated().shift_s, timeshift_s_ + calibrated().shift_s) +
        Figures(*check);
    check->contradiction_is_time_shift = true;
  }
}

GyroscopeFilter VisionComparer::FindFilter() {
  Explanation filtered = calibrated();
  search_.RefineLag(&filtered);
  GyroscopeFilter filter;
  if (search_.Evidence(calibrated(), filtered) < kMinEvidence) return filter;
  // With a lag, the best shift without it depends on the interval. Priors join
  // successive frames, so the shortest interval counts.
  search_.RefineShiftOfOneFrame(&explanations_[0]);
  filter.lag_s = filtered.lag_s;
  filter.delay_s = filtered.shift_s - calibrated().shift_s;
  return filter;
}

VisionCheck VisionComparer::Run() {
  VisionCheck check;
  // 1. Every explanation at its best time shift.
  if (!FindBestShifts()) return check;
  // 2. How well the calibration fits as it is.
  CompareAsIs(&check);
  // 3. A mistake that explains vision better.
  if (NameMistake(&check)) return check;
  // 4. Pictures that rotate differently from the camera.
  if (FindOtherMotion(&check)) return check;
  if (check.shifted_correlation < kMinAgreeingCorrelation) {
    if (check.total_correlation >= kMinAgreeingCorrelation) return check;
    // 5. Nothing fits: is the gyroscope worse than none?
    if (!IsWorseThanNone()) return VisionCheck();
    check.contradiction =
        "vision and gyroscope contradict each other: check T_cam_imu, the "
        "clocks and whether log and images belong together" +
        Figures(check);
    return check;
  }
  // 6. The gyroscope's scale.
  CheckTurnScale(&check);
  if (!check.contradiction.empty()) return check;
  // 7. A filter, which no time shift explains.
  check.filter = FindFilter();
  // 8. The time shift.
  CheckTimeShift(&check);
  return check;
}

}  // namespace

VisionCheck CheckAgainstVision(const std::vector<TimedRotation>& rotations,
                               const std::vector<ImuSample>& imu,
                               const SensorCalibration& calibration) {
  if (imu.size() < 2) return VisionCheck();
  return VisionComparer(rotations, imu, calibration).Run();
}

}  // namespace adasfm
