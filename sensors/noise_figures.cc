// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/noise_figures.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/types.h"
#include "sensors/io/format_figures.h"

namespace adasfm {
namespace {

constexpr double kStretchS = 1.0;
constexpr size_t kMinNumStretches = 8;
// Quantile of the stretches' variances that counts as their quieter part.
constexpr double kQuietShare = 0.25;
// Stated figures are kept within this factor: estimates err by some percent.
constexpr double kMinFactor = 1.2;
// A figure this much too small is another sensor's, or in another unit.
constexpr double kWrongFactor = 5.0;

// On the drives measured a gyroscope loses a third of its loss at half the
// rate. Beyond this ratio of the half-rate loss to the noise the loss exceeds
// the noise.
constexpr double kMaxHalfRateLoss = 3.0;
constexpr double kMaxGapPeriods = 4.0;

// Largest factor by which the smoother's residuals raise a stated figure.
constexpr double kMaxNoiseFactor = 5.0;
// Slip is proportional to the speed and in no stated noise: on gravel wheels
// err by 40 times theirs. The variance of sums over seconds needs as large a
// limit.
constexpr double kMaxWheelNoiseFactor = 100.0;
constexpr double kMaxWheelPersistence = 100.0;
// Smaller changes are errors of estimates from some hundred residuals.
constexpr double kMinNoiseChange = 1.2;

// The readings of one quantity, in order of time.
struct Readings {
  std::vector<timestamp_t> times_ns;
  std::vector<Eigen::Vector3d> values;
  int num_axes = 3;

  void Add(timestamp_t time_ns, const Eigen::Vector3d& value) {
    times_ns.push_back(time_ns);
    values.push_back(value);
  }
  double PeriodS() const {
    return SecondsFromNs(times_ns.back() - times_ns.front()) /
           (times_ns.size() - 1.0);
  }
};

// The kQuietShare quantile of chi-square / n with n degrees of freedom (Wilson
// and Hilferty).
double QuietQuantile(double n) {
  constexpr double kNormalQuantile = -0.6745;
  const double spread = 2.0 / (9.0 * n);
  return std::pow(1.0 - spread + kNormalQuantile * std::sqrt(spread), 3);
}

// Squared density, from second differences of the means over blocks of
// readings; infinite when the log is too short.
double QuietDensity2(const Readings& readings, size_t block) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  const double period_s = readings.PeriodS();
  const size_t num_triples = static_cast<size_t>(
      kStretchS / (3.0 * static_cast<double>(block) * period_s));
  if (num_triples == 0) return kUnknown;
  const auto mean = [&](size_t first) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (size_t i = first; i < first + block; ++i) sum += readings.values[i];
    return Eigen::Vector3d(sum / static_cast<double>(block));
  };
  const double num_differences =
      static_cast<double>(readings.num_axes) * num_triples;
  std::vector<double> variances;
  const size_t stretch = 3 * block * num_triples;
  for (size_t start = 0; start + stretch <= readings.values.size();
       start += stretch) {
    double sum = 0.0;
    for (size_t i = start; i < start + stretch; i += 3 * block) {
      sum +=
          (mean(i) - 2.0 * mean(i + block) + mean(i + 2 * block)).squaredNorm();
    }
    // The difference of white noise has six times the variance of a mean.
    if (sum > 0.0) variances.push_back(sum / (6.0 * num_differences));
  }
  if (variances.size() < kMinNumStretches) return kUnknown;
  const auto quiet =
      variances.begin() + static_cast<int64_t>(kQuietShare * variances.size());
  std::nth_element(variances.begin(), quiet, variances.end());
  return *quiet / QuietQuantile(num_differences) * static_cast<double>(block) *
         period_s;
}

// Upper bound of the white noise's density; 0 when the log is too short.
double LeastDensity(const Readings& readings) {
  if (readings.values.size() < 2) return 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (const size_t block : {1, 4, 16}) {
    least = std::min(least, QuietDensity2(readings, block));
  }
  return std::isfinite(least) ? std::sqrt(least) : 0.0;
}

void Raise(const char* name, double shown, double min_factor, double* figure,
           std::vector<std::string>* warnings) {
  if (shown <= min_factor * *figure) return;
  if (shown > kWrongFactor * *figure) {
    warnings->push_back(
        std::string(name) +
        FormatFigures(" is %.3g, but the log's noise in its quietest seconds "
                      "is %.3g, which is used: correct the noise figures",
                      *figure, shown));
  }
  *figure = shown;
}

// Change of integrals over a second without every other reading, as the density
// of white noise that causes the same change. 0 when the log is too short.
double HalfRateLoss(const Readings& readings) {
  if (readings.values.size() < 3) return 0.0;
  const double max_step_s = kMaxGapPeriods * readings.PeriodS();
  const auto seconds = [&](size_t begin, size_t end) {
    return SecondsFromNs(readings.times_ns[end] - readings.times_ns[begin]);
  };
  Eigen::Vector3d change = Eigen::Vector3d::Zero();
  double sum = 0.0, change_s = 0.0, sum_s = 0.0;
  for (size_t i = 0; i + 2 < readings.values.size(); i += 2) {
    const double step_s = seconds(i, i + 2);
    if (step_s > max_step_s) continue;
    const Eigen::Vector3d& first = readings.values[i];
    const Eigen::Vector3d& last = readings.values[i + 2];
    const Eigen::Vector3d& middle = readings.values[i + 1];
    // The trapezoidal rule with the middle reading, minus the rule without it.
    change += 0.5 * (seconds(i, i + 1) * (first + middle) +
                     seconds(i + 1, i + 2) * (middle + last) -
                     step_s * (first + last));
    change_s += step_s;
    if (change_s < kStretchS) continue;
    sum += change.squaredNorm() / readings.num_axes;
    sum_s += change_s;
    change.setZero();
    change_s = 0.0;
  }
  if (sum_s < kMinNumStretches * kStretchS) return 0.0;
  return std::sqrt(sum / sum_s);
}

// Adds the loss between the samples to the density, where it exceeds the noise.
void AddRateLoss(const Readings& rates, double* density,
                 std::vector<std::string>* warnings) {
  const double loss = HalfRateLoss(rates);
  if (loss <= kMaxHalfRateLoss * *density) return;
  const double raised = std::hypot(*density, loss / kMaxHalfRateLoss);
  warnings->push_back(
      FormatFigures("the gyroscope's %.3g Hz are slow for this drive: at half "
                    "of that its rotations change by %.3g rad/sqrt(s), ",
                    1.0 / rates.PeriodS(), loss) +
      FormatFigures("where noise explains %.3g; %.3g is used: record it faster",
                    *density, raised));
  *density = raised;
}

// Multiplies a factor by another, within 1 and max_factor. False, without a
// change, when it would change by less than kMinNoiseChange.
bool MoveFactor(double by, double max_factor, double* factor) {
  const double corrected = std::clamp(*factor * by, 1.0, max_factor);
  const double change = corrected / *factor;
  if (std::max(change, 1.0 / change) < kMinNoiseChange) return false;
  *factor = corrected;
  return true;
}

}  // namespace

void RaiseNoiseFigures(const MotionLogs& logs, SensorCalibration* calibration,
                       std::vector<std::string>* warnings) {
  Readings rates, forces;
  for (const ImuSample& sample : logs.imu) {
    rates.Add(sample.timestamp_ns, sample.angular_velocity);
    forces.Add(sample.timestamp_ns, sample.specific_force);
  }
  ImuNoise& noise = calibration->imu_noise;
  Raise("gyroscope_noise_density", LeastDensity(rates), kMinFactor,
        &noise.gyroscope_noise_density, warnings);
  Raise("accelerometer_noise_density", LeastDensity(forces), kMinFactor,
        &noise.accelerometer_noise_density, warnings);
  AddRateLoss(rates, &noise.gyroscope_noise_density, warnings);
  if (CountsTicks(calibration->wheel_type) || logs.wheel.size() < 2) return;
  Readings speeds;
  speeds.num_axes = 1;
  for (const WheelSpeed& speed : logs.wheel) {
    speeds.Add(speed.timestamp_ns, Eigen::Vector3d(speed.speed, 0.0, 0.0));
  }
  // The mean of two wheels is less noisy than one.
  const double num_wheels =
      calibration->wheel_type == WheelType::kDifferential ? 2.0 : 1.0;
  Raise("speed_noise",
        std::sqrt(num_wheels / speeds.PeriodS()) * LeastDensity(speeds),
        kWrongFactor, &calibration->wheel_speed_noise, warnings);
}

bool CorrectNoiseFigures(const SensorCalibration& stated,
                         const OdometryFusionResult& fused,
                         SensorCalibration* in_use, double* wheel_persistence,
                         SensorSummary* summary) {
  NoiseCheck speed = fused.wheel_speed_check;
  NoiseCheck yaw = fused.wheel_yaw_check;
  if (stated.wheel_type == WheelType::kDifferential ||
      stated.wheel_type == WheelType::kTicks) {
    // Two wheels have one figure, that of a wheel's speed.
    speed.chi2 += yaw.chi2;
    speed.redundancy += yaw.redundancy;
    yaw = NoiseCheck();
  }
  bool any = MoveFactor(speed.Factor(), kMaxWheelNoiseFactor,
                        &summary->wheel_speed_noise_factor);
  any |= MoveFactor(yaw.Factor(), kMaxNoiseFactor,
                    &summary->wheel_yaw_noise_factor);
  double persistence = std::sqrt(*wheel_persistence);
  any |= MoveFactor(std::sqrt(fused.wheel_persistence / *wheel_persistence),
                    std::sqrt(kMaxWheelPersistence), &persistence);
  *wheel_persistence = persistence * persistence;
  double accelerometer = in_use->imu_noise.accelerometer_noise_density /
                         stated.imu_noise.accelerometer_noise_density;
  any |= MoveFactor(fused.accelerometer_check.Factor(), kMaxNoiseFactor,
                    &accelerometer);
  in_use->imu_noise.accelerometer_noise_density =
      accelerometer * stated.imu_noise.accelerometer_noise_density;
  in_use->wheel_speed_noise =
      summary->wheel_speed_noise_factor * stated.wheel_speed_noise;
  in_use->wheel_yaw_rate_noise =
      summary->wheel_yaw_noise_factor * stated.wheel_yaw_rate_noise;
  return any;
}

}  // namespace adasfm
