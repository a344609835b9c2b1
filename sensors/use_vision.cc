// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/use_vision.h"

#include <cmath>
#include <string>

#include "sensors/calibration_check/clock_jump.h"
#include "sensors/io/format_figures.h"

namespace adasfm {
namespace {

// Below this correlation gyroscope and pictures are of different drives; a
// stabilised video keeps the slow rotations.
constexpr double kMinSameMotionCorrelation = 0.4;
// Error that all two-view rotations share and that their scatter does not show,
// as a rate, 1 sigma.
constexpr double kVisualBiasSigma = 0.002;  // rad/s

class VisionComparison {
 public:
  VisionComparison(const SensorCalibration& calibration,
                   const PriorEstimationOptions& options, MotionLogs* logs,
                   VisionUse* vision, SensorSummary* summary)
      : calibration_(calibration),
        options_(options),
        logs_(*logs),
        vision_(*vision),
        summary_(*summary) {}

  Status Run();

 private:
  void CorrectTimeShift(const VisionCheck& check);
  // Clears the IMU log; the other logs stay. An error for wheels of another
  // drive.
  Status LeaveOutImu(const VisionCheck& check);
  void SetBias(const VisionCheck& check);
  void UndoFilter(const VisionCheck& check);

  const SensorCalibration& calibration_;
  const PriorEstimationOptions& options_;
  MotionLogs& logs_;
  VisionUse& vision_;
  SensorSummary& summary_;
};

Status VisionComparison::Run() {
  if (logs_.imu.empty() || vision_.rotations.empty()) return Status::Ok();
  VisionCheck check =
      CheckAgainstVision(vision_.rotations, logs_.imu, calibration_);
  if (check.contradiction_is_time_shift) {
    const std::string jump =
        FindClockJump(vision_.rotations, logs_.imu, calibration_);
    check.contradiction_is_time_shift = jump.empty();
    if (!jump.empty()) check.contradiction = jump;
  }
  if (!check.is_conclusive) {
    summary_.warnings.push_back(
        "the gyroscope cannot be checked against vision: too little rotation, "
        "or two-view rotations that are too few or too noisy");
    return Status::Ok();
  }
  summary_.visual_timeshift_correction_s = check.time_shift_correction_s;
  summary_.unexplained_rotation = check.unexplained;
  if (check.contradiction_is_motion && options_.check_against_vision) {
    return LeaveOutImu(check);
  }
  const bool may_correct =
      check.contradiction.empty() || check.contradiction_is_time_shift;
  if (may_correct &&
      (options_.estimate_time_shift == 1 ||
       (options_.estimate_time_shift == -1 && check.is_clock_shift))) {
    CorrectTimeShift(check);
  } else if (!check.contradiction.empty()) {
    if (options_.check_against_vision) {
      return Status::Error(check.contradiction);
    }
    summary_.warnings.push_back(check.contradiction);
    vision_.rotations.clear();
    return Status::Ok();
  }
  SetBias(check);
  if (options_.undo_gyroscope_filter) UndoFilter(check);
  return Status::Ok();
}

void VisionComparison::CorrectTimeShift(const VisionCheck& check) {
  vision_.timeshift_ns += NsFromSeconds(check.time_shift_correction_s);
  summary_.timeshift_was_corrected = true;
  if (options_.estimate_time_shift == 1) return;
  summary_.warnings.push_back(FormatFigures(
      "vision and gyroscope show a time offset that differs by %+.4f s from "
      "timeshift_cam_imu; the priors use the corrected value: set "
      "timeshift_cam_imu: %.4f in the calibration",
      check.time_shift_correction_s, SecondsFromNs(vision_.timeshift_ns)));
}

Status VisionComparison::LeaveOutImu(const VisionCheck& check) {
  if (!(logs_.wheel.empty() && logs_.odometry.empty()) &&
      check.shifted_correlation < kMinSameMotionCorrelation) {
    return Status::Error(
        "vision and gyroscope contradict each other: check T_cam_imu, the "
        "clocks and whether logs and images belong together (" +
        check.contradiction + ")");
  }
  summary_.imu_was_left_out = true;
  summary_.warnings.push_back(
      check.contradiction +
      ". The IMU is left out: a likely cause is video stabilisation, which "
      "rotates the images; switch it off (--force 1 uses the IMU all the "
      "same)");
  logs_.imu.clear();
  vision_.rotations.clear();
  return Status::Ok();
}

void VisionComparison::SetBias(const VisionCheck& check) {
  vision_.has_bias = options_.use_visual_rotations;
  // The prior of the bias is zero, with gyroscope_bias_sigma.
  const double visual_variance =
      std::pow(kVisualBiasSigma, 2) + std::pow(check.gyroscope_bias_sigma, 2);
  const double prior_variance =
      std::pow(options_.fusion.gyroscope_bias_sigma, 2);
  const double share = prior_variance / (prior_variance + visual_variance);
  vision_.bias = share * check.gyroscope_bias;
  vision_.bias_sigma = std::sqrt((1.0 - share) * prior_variance);
}

void VisionComparison::UndoFilter(const VisionCheck& check) {
  if (check.filter.lag_s == 0.0) return;
  // For the time shift in use.
  GyroscopeFilter filter = check.filter;
  filter.delay_s += calibration_.timeshift_cam_imu_s +
                    check.time_shift_correction_s -
                    SecondsFromNs(vision_.timeshift_ns);
  UndoGyroscopeFilter(filter, &logs_.imu);
  summary_.gyroscope_lag_s = filter.lag_s;
  summary_.gyroscope_delay_s = filter.delay_s;
}

}  // namespace

Status UseVision(const SensorCalibration& calibration,
                 const PriorEstimationOptions& options, MotionLogs* logs,
                 VisionUse* vision, SensorSummary* summary) {
  return VisionComparison(calibration, options, logs, vision, summary).Run();
}

}  // namespace adasfm
