// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/check_wheels.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "sensors/calibration_check/calibration_mistakes.h"
#include "sensors/calibration_check/motion_bins.h"
#include "sensors/calibration_check/rotation_comparison.h"
#include "sensors/io/format_figures.h"

namespace adasfm {
namespace {

// Clock errors looked for, and the smallest one that is named.
constexpr double kMaxLogShiftS = 10.0;
constexpr int kMinShiftBins = 2;
// Logs of one drive fit best at their own clock; logs of different drives fit
// there no better than elsewhere. The best of the 160 shifts beyond kFarShiftS
// is by chance e^5 times likelier than most; no shift must be likelier than
// that one by the same factor.
constexpr double kFarShiftS = 2.0;
constexpr double kBelongingEvidence = 5.0;
// Windows overlap: so many bins count as one observation.
constexpr double kBinsPerObservation = 4.0;
// Gravity further than this from the wheel frame's z is more than a tilted road
// or inexact extrinsics.
constexpr double kMaxTiltDeg = 40.0;
// Figures count above this correlation ...
constexpr double kMinCorrelation = 0.7;
// ... and above this rms of the motion.
constexpr double kMinAcceleration = 0.3;  // m/s^2
constexpr double kMinYawRate = 0.03;      // rad/s
constexpr int kMinNumBins = 50;
// Logs with enough motion and a correlation below this may not belong together.
// Without a yaw rate the limit is lower, since engines and rough ground shake.
// Wheels that slip on loose ground correlate no better, so the clock decides.
constexpr double kNoCorrelation = 0.5;
constexpr double kNoForceCorrelation = 0.2;
// Wheel directions beyond this are more than badly measured extrinsics.
constexpr double kMaxTurnDeg = 30.0;
// Factors within this are right, or are found by the smoother.
constexpr double kMaxFactor = 1.5;
// Smaller factors may come from wheels that spun while a straight drive gained
// speed: no two units are that close.
constexpr double kMinUnitFactor = 1.9;

class WheelChecker {
 public:
  WheelChecker(const MotionBins& bins, bool has_yaw,
               const SensorCalibration& calibration)
      : bins_(bins), has_yaw_(has_yaw), calibration_(calibration) {}

  WheelCheck Run();

 private:
  double LogLikelihood(const WheelFit& as_logged, const WheelFit& fit) const;
  bool ObservesForce(const WheelFit& fit) const {
    return fit.acceleration_rms > kMinAcceleration &&
           fit.force_correlation > kMinCorrelation;
  }
  bool FitsYaw(const WheelFit& fit) const {
    return has_yaw_ && fit.yaw_rate_rms > kMinYawRate &&
           std::abs(fit.yaw_correlation) > kMinCorrelation;
  }
  std::string CheckGravity(const WheelCheck& check) const;
  // How well the logs fit at the clocks around the logged one.
  struct ClockScan {
    double as_logged = 0.0;  // log likelihoods
    double best = 0.0;
    double best_far = 0.0;
    int best_shift = 0;  // bins
  };
  ClockScan ScanClocks(const WheelFit& fit) const;
  std::string CheckClock(const ClockScan& scan) const;
  std::string CheckBelonging(const WheelFit& fit, const ClockScan& scan) const;
  std::string CheckAxes(const WheelFit& fit) const;
  std::string CheckDirection(const WheelFit& fit) const;
  std::string CheckUnits(const WheelFit& fit,
                         std::vector<std::string>* warnings) const;
  // The accelerometer's axes that explain gravity and acceleration best.
  std::string NameAxes() const;

  const MotionBins& bins_;
  bool has_yaw_;
  const SensorCalibration& calibration_;
};

// Which motions count depends on the logs as they are: at another clock the rms
// is a little different, and a motion that counted only there would make that
// clock the likelier one.
double WheelChecker::LogLikelihood(const WheelFit& as_logged,
                                   const WheelFit& fit) const {
  const auto gain = [&](double correlation) {
    return -0.5 * fit.sum_of_weights / kBinsPerObservation *
           std::log(1.0 - 0.999 * correlation * correlation);
  };
  // Correlations are squared: wheels may count backwards or be exchanged.
  double sum = as_logged.acceleration_rms > kMinAcceleration
                   ? gain(fit.forward_correlation)
                   : 0.0;
  if (has_yaw_ && as_logged.yaw_rate_rms > kMinYawRate) {
    sum += gain(fit.yaw_correlation);
  }
  return sum;
}

std::string WheelChecker::NameAxes() const {
  const Eigen::Matrix3d wheel_from_imu =
      calibration_.imu_from_wheel.rotation.conjugate().toRotationMatrix();
  std::string name;
  double best = -1.0;
  for (const CalibrationMistake& mistake :
       ListCalibrationMistakes(Eigen::Matrix3d::Identity())) {
    if (mistake.kind != CalibrationMistake::kAxes) continue;
    const Eigen::Matrix3d axes =
        wheel_from_imu * mistake.axes * wheel_from_imu.transpose();
    const Eigen::Vector3d force = axes * bins_.MeanForce();
    const double tilt_deg =
        RadToDeg(std::acos(std::clamp(force.z() / force.norm(), -1.0, 1.0)));
    if (tilt_deg > kMaxTiltDeg) continue;
    const WheelFit fit = FitWheels(bins_, axes, 0);
    // The score includes the sign of the acceleration.
    const double score = std::cos(std::arg(fit.force)) * fit.force_correlation;
    if (score <= best + 0.02) continue;
    best = score;
    name = AxesToString(mistake.axes);
  }
  return name;
}

std::string WheelChecker::CheckGravity(const WheelCheck& check) const {
  const Eigen::Vector3d& force = check.mean_force;
  const double tilt_deg =
      RadToDeg(std::acos(std::clamp(force.z() / force.norm(), -1.0, 1.0)));
  if (tilt_deg < kMaxTiltDeg) return "";
  const std::string figures = FormatFigures(
      " (gravity is %.0f deg off the wheel frame's z axis, which T_imu_wheel "
      "must let point up; correlation of the yaw rates %.2f)",
      tilt_deg, check.fit.yaw_correlation);
  if (FitsYaw(check.fit) && std::abs(check.fit.yaw_correlation) > 0.9 &&
      check.fit.yaw_correlation < 0.0 && tilt_deg > 180.0 - kMaxTiltDeg) {
    return "T_imu_wheel is upside down: its third column must be the axis of "
           "the IMU that points up" +
           figures;
  }
  if (tilt_deg > 180.0 - kMaxTiltDeg) {
    const bool only_z =
        ObservesForce(check.fit) && check.fit.force.real() > 0.0;
    return std::string("the accelerometer") + (only_z ? "'s z axis" : "") +
           " has the other sign: at rest it must read +9.81 m/s^2 upwards "
           "(specific force); multiply the log's " +
           (only_z ? "z acceleration" : "accelerations") + " by -1" + figures;
  }
  const std::string axes = NameAxes();
  return "the accelerometer's axes do not fit T_imu_wheel: " +
         (axes.empty() ? std::string("check both")
                       : "gravity and acceleration fit when the log's "
                         "accelerations are read as " +
                             axes) +
         figures;
}

WheelChecker::ClockScan WheelChecker::ScanClocks(const WheelFit& fit) const {
  const int max_shift =
      static_cast<int>(std::lround(kMaxLogShiftS / MotionBins::kBinS));
  ClockScan scan;
  scan.as_logged = scan.best = LogLikelihood(fit, fit);
  for (int bins = -max_shift; bins <= max_shift; ++bins) {
    const WheelFit shifted =
        FitWheels(bins_, Eigen::Matrix3d::Identity(), bins);
    if (shifted.num_windows < kMinNumBins) continue;
    const double likelihood = LogLikelihood(fit, shifted);
    if (std::abs(bins) * MotionBins::kBinS > kFarShiftS) {
      scan.best_far = std::max(scan.best_far, likelihood);
    }
    if (likelihood > scan.best) {
      scan.best = likelihood;
      scan.best_shift = bins;
    }
  }
  return scan;
}

std::string WheelChecker::CheckClock(const ClockScan& scan) const {
  if (std::abs(scan.best_shift) < kMinShiftBins ||
      scan.best < scan.as_logged + kMinEvidence) {
    return "";
  }
  return FormatFigures(
      "the wheels' clock differs from the IMU's: both fit when %+.1f s are "
      "added to the times of the wheel log (evidence e^%.0f)",
      scan.best_shift * MotionBins::kBinS, scan.best - scan.as_logged);
}

std::string WheelChecker::CheckBelonging(const WheelFit& fit,
                                         const ClockScan& scan) const {
  const bool has_turns = has_yaw_ && fit.yaw_rate_rms > kMinYawRate;
  const double bar = has_turns ? kNoCorrelation : kNoForceCorrelation;
  if (fit.acceleration_rms < kMinAcceleration || fit.force_correlation > bar ||
      fit.mirrored_correlation > kMinCorrelation ||
      (has_turns && std::abs(fit.yaw_correlation) > bar) ||
      scan.as_logged > scan.best_far + kBelongingEvidence) {
    return "";
  }
  return FormatFigures(
      "the wheels' motion does not fit the IMU's at all (correlation of the "
      "accelerations %.2f, of the yaw rates %.2f): is it the log of another "
      "drive, or of another clock?",
      fit.force_correlation, fit.yaw_correlation);
}

std::string WheelChecker::CheckAxes(const WheelFit& fit) const {
  if (fit.acceleration_rms < kMinAcceleration ||
      fit.mirrored_correlation < kMinCorrelation) {
    return "";
  }
  // Counts independent observations, as LogLikelihood does.
  const auto misfit = [](double correlation) {
    return std::log(1.0 - 0.999 * correlation * correlation);
  };
  const double evidence =
      fit.sum_of_weights / kBinsPerObservation *
      (misfit(fit.force_correlation) - misfit(fit.mirrored_correlation));
  if (evidence < kMinEvidence) return "";
  return "the accelerometer's horizontal axes do not fit the wheels and the "
         "gyroscope: they fit when the log's accelerations are read as " +
         NameAxes() +
         FormatFigures(" (correlation %.2f as logged, %.2f then)",
                       fit.force_correlation, fit.mirrored_correlation);
}

std::string WheelChecker::CheckDirection(const WheelFit& fit) const {
  if (!ObservesForce(fit)) return "";
  const double turn_deg = RadToDeg(std::arg(fit.force));
  if (std::abs(turn_deg) < kMaxTurnDeg) return "";
  if (std::abs(turn_deg) > 180.0 - kMaxTurnDeg) {
    return FitsYaw(fit) && fit.yaw > 0.0
               ? "the wheels drive backwards where the accelerometer drives "
                 "forwards, but turn to the same side: T_imu_wheel is turned "
                 "by 180 deg about z, or the wheels are negative and left and "
                 "right exchanged"
               : "the wheels count backwards: multiply the wheel log's speeds "
                 "by -1 (or turn T_imu_wheel by 180 deg about z when only the "
                 "forward speed has the other sign)";
  }
  return FormatFigures(
      "T_imu_wheel looks turned about z by %.0f deg: its first column must be "
      "the axis of the IMU that points forward (correlation %.2f)",
      turn_deg, fit.force_correlation);
}

std::string WheelChecker::CheckUnits(const WheelFit& fit,
                                     std::vector<std::string>* warnings) const {
  if (!ObservesForce(fit)) return "";
  // Noise reduces a factor, at most by the squared correlation.
  const double low = std::abs(fit.force);
  const double high = low / (fit.force_correlation * fit.force_correlation);
  if (high < 1.0 / kMaxFactor || low > kMaxFactor) {
    const double logged = 1.0 / std::sqrt(low * high);
    const bool is_kmh = logged > 2.9 && logged < 4.4;
    const std::string text =
        FormatFigures(
            "the wheel log's speeds are %.2g times those of the "
            "accelerometer: ",
            logged) +
        (is_kmh ? "they look like km/h: divide them by 3.6 (m/s are expected)"
                : "check their unit (m/s are expected), metres_per_tick and "
                  "the wheels' radius");
    if (logged > kMinUnitFactor || logged < 1.0 / kMinUnitFactor) return text;
    warnings->push_back(text + ", unless they spun");
  }
  if (!FitsYaw(fit)) return "";
  if (fit.yaw < 0.0) {
    warnings->push_back(
        "the wheels turn to the other side than the gyroscope: left and right "
        "are exchanged in the wheel log");
  } else if (fit.yaw > kMaxFactor || fit.yaw < 1.0 / kMaxFactor) {
    warnings->push_back(FormatFigures(
        "the wheels turn %.2f times as much as the gyroscope: check "
        "track_width (now %.3g m), or the yaw rate's unit",
        fit.yaw, calibration_.track_width_m));
  }
  return "";
}

WheelCheck WheelChecker::Run() {
  WheelCheck check;
  check.mean_force = bins_.MeanForce();
  check.fit = FitWheels(bins_, Eigen::Matrix3d::Identity(), 0);
  if (check.fit.num_windows < kMinNumBins) return check;
  std::string& contradiction = check.contradiction;
  // A mistake that would also cause later contradictions comes first.
  contradiction = CheckGravity(check);
  const ClockScan scan = ScanClocks(check.fit);
  if (contradiction.empty()) contradiction = CheckClock(scan);
  if (contradiction.empty()) contradiction = CheckBelonging(check.fit, scan);
  if (contradiction.empty()) contradiction = CheckAxes(check.fit);
  if (contradiction.empty()) contradiction = CheckDirection(check.fit);
  if (contradiction.empty()) {
    contradiction = CheckUnits(check.fit, &check.warnings);
  }
  return check;
}

}  // namespace

WheelCheck CheckWheels(const std::vector<ImuSample>& imu,
                       const std::vector<WheelSpeed>& speeds, bool has_yaw,
                       const SensorCalibration& calibration) {
  const MotionBins bins(imu, speeds,
                        calibration.imu_from_wheel.rotation.conjugate());
  if (bins.size() < kMinNumBins) return WheelCheck();
  return WheelChecker(bins, has_yaw, calibration).Run();
}

}  // namespace adasfm
