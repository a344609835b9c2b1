// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/wheel_clock.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/median.h"
#include "sensors/calibration_check/rotation_comparison.h"

namespace adasfm {
namespace {

constexpr double kMaxClockShiftS = 0.15;
constexpr double kClockStepS = 0.002;
constexpr double kWindowS = 0.2;
// Wheels are not compared over holes of their log.
constexpr double kMaxGapS = 0.25;
// That many suffice; more would only take time.
constexpr size_t kMaxNumWindows = 1000;
constexpr size_t kMinNumWindows = 50;
constexpr double kMinYawRateRms = 0.02;  // rad/s
constexpr double kMaxCostRatio = 0.9;

// The wheels' rotation over one window, rad.
struct TurnWindow {
  timestamp_t start_ns = 0;
  timestamp_t end_ns = 0;
  double yaw = 0.0;
};

std::vector<TurnWindow> ListWindows(const std::vector<WheelSpeed>& speeds) {
  std::vector<TurnWindow> windows;
  size_t begin = 0;
  double yaw = 0.0;
  for (size_t i = 1; i < speeds.size(); ++i) {
    const WheelSpeed& a = speeds[i - 1];
    const WheelSpeed& b = speeds[i];
    const double dt = SecondsFromNs(b.timestamp_ns - a.timestamp_ns);
    if (dt > kMaxGapS) {
      begin = i;
      yaw = 0.0;
      continue;
    }
    yaw += 0.5 * dt * (a.yaw_rate + b.yaw_rate);
    const timestamp_t start_ns = speeds[begin].timestamp_ns;
    if (SecondsFromNs(b.timestamp_ns - start_ns) < kWindowS) continue;
    windows.push_back({start_ns, b.timestamp_ns, yaw});
    begin = i;
    yaw = 0.0;
  }
  std::vector<TurnWindow> selected;
  const size_t stride = windows.size() / kMaxNumWindows + 1;
  for (size_t i = 0; i < windows.size(); i += stride) {
    selected.push_back(windows[i]);
  }
  return selected;
}

class ClockSearch {
 public:
  ClockSearch(const std::vector<ImuSample>& imu,
              const std::vector<WheelSpeed>& speeds,
              const Eigen::Vector3d& up_in_imu)
      : integral_(imu), up_in_imu_(up_in_imu) {
    // Covered at every shift, so that no shift has fewer windows.
    const timestamp_t margin_ns = NsFromSeconds(kMaxClockShiftS);
    for (const TurnWindow& window : ListWindows(speeds)) {
      if (!integral_.Covers(window.start_ns - margin_ns) ||
          !integral_.Covers(window.end_ns + margin_ns)) {
        continue;
      }
      windows_.push_back(window);
    }
  }

  std::optional<double> Run() const {
    if (windows_.size() < kMinNumWindows || YawRateRms() < kMinYawRateRms) {
      return std::nullopt;
    }
    const std::vector<double> unshifted = Distances(0.0);
    double best_s = 0.0, least = Mean(unshifted);
    const int num_steps =
        static_cast<int>(std::round(kMaxClockShiftS / kClockStepS));
    for (int step = -num_steps; step <= num_steps; ++step) {
      const double cost = Mean(Distances(step * kClockStepS));
      if (cost >= least) continue;
      least = cost;
      best_s = step * kClockStepS;
    }
    // At the end of the range the right shift lies beyond.
    if (least > kMaxCostRatio * Mean(unshifted) ||
        std::abs(best_s) > kMaxClockShiftS - 1.5 * kClockStepS ||
        ComputeEvidence(unshifted, Distances(best_s), 1.0) < kMinEvidence) {
      return std::nullopt;
    }
    return best_s;
  }

 private:
  static double Mean(const std::vector<double>& values) {
    double sum = 0.0;
    for (const double value : values) sum += value;
    return sum / values.size();
  }

  double YawRateRms() const {
    double sum = 0.0;
    for (const TurnWindow& window : windows_) {
      const double rate =
          window.yaw / SecondsFromNs(window.end_ns - window.start_ns);
      sum += rate * rate;
    }
    return std::sqrt(sum / windows_.size());
  }

  // Of the yaw rates, about their median.
  std::vector<double> Distances(double shift_s) const {
    const timestamp_t shift_ns = NsFromSeconds(shift_s);
    std::vector<double> gyro, wheel;
    for (const TurnWindow& window : windows_) {
      const double dt = SecondsFromNs(window.end_ns - window.start_ns);
      gyro.push_back(up_in_imu_.dot(integral_.At(window.end_ns + shift_ns) -
                                    integral_.At(window.start_ns + shift_ns)) /
                     dt);
      wheel.push_back(window.yaw / dt);
    }
    double both = 0.0, square = 0.0;
    for (size_t i = 0; i < gyro.size(); ++i) {
      both += gyro[i] * wheel[i];
      square += gyro[i] * gyro[i];
    }
    const double scale = square > 0.0 ? both / square : 0.0;
    std::vector<double> distances(gyro.size());
    for (size_t i = 0; i < gyro.size(); ++i) {
      distances[i] = wheel[i] - scale * gyro[i];
    }
    std::vector<double> values = distances;
    const double median = UpperMedian(&values);
    for (double& distance : distances) distance = std::abs(distance - median);
    return distances;
  }

  RateIntegral integral_;
  Eigen::Vector3d up_in_imu_;
  std::vector<TurnWindow> windows_;
};

}  // namespace

std::optional<double> FindWheelClockShift(
    const std::vector<ImuSample>& imu, const std::vector<WheelSpeed>& speeds,
    const SensorCalibration& calibration) {
  if (imu.size() < 2 || !ObservesYaw(calibration.wheel_type))
    return std::nullopt;
  return ClockSearch(
             imu, speeds,
             calibration.imu_from_wheel.rotation * Eigen::Vector3d::UnitZ())
      .Run();
}

}  // namespace adasfm
