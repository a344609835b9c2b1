// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/motion_bins.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "sensors/calibration_check/check_wheels.h"

namespace adasfm {
namespace {

using Complex = std::complex<double>;

// A window of five bins; the outer two count half.
constexpr int kReach = 2;
constexpr double kWeights[] = {0.125, 0.25, 0.25, 0.25, 0.125};
// Of longer drives the first hour is enough.
constexpr double kMaxLengthS = 3600.0;

// Errors beyond this many sigmas are slips; errors below this (m/s^2) are not.
constexpr double kMaxSigmas = 3.0;
constexpr double kMinSlip = 0.1;
// Slips may fill more than half of a short log, but hardly three quarters, so
// the noise is found from the lowest quartile of the errors. A quarter of plane
// vectors with unit sigmas is shorter than this.
constexpr double kRayleighQuarter = 0.7585;
constexpr int kNumReweightings = 10;

// Means of both logs over one window.
struct Window {
  Complex acceleration;  // (dv/dt, v w_z), gyroscope's w_z
  Complex force;
  double wheel_yaw = 0.0;
  double gyroscope_yaw = 0.0;
  double weight = 1.0;
};

bool IsFull(const MotionBins& bins, int middle, bool of_imu) {
  if (middle < kReach || middle + kReach >= bins.size()) return false;
  for (int i = middle - kReach; i <= middle + kReach; ++i) {
    if ((of_imu ? bins[i].num_imu : bins[i].num_wheel) == 0) return false;
  }
  return true;
}

std::vector<Window> MakeWindows(const MotionBins& bins,
                                const Eigen::Matrix3d& axes, int shift) {
  std::vector<Window> windows;
  for (int i = kReach; i + kReach < bins.size(); ++i) {
    const int j = i - shift;
    if (!IsFull(bins, i, true) || !IsFull(bins, j, false)) continue;
    Window window;
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    double speed = 0.0;
    for (int k = -kReach; k <= kReach; ++k) {
      const double weight = kWeights[k + kReach];
      force += weight * bins[i + k].force;
      window.gyroscope_yaw += weight * bins[i + k].rate.z();
      window.wheel_yaw += weight * bins[j + k].yaw_rate;
      speed += weight * bins[j + k].speed;
    }
    force = axes * force;
    window.force = Complex(force.x(), force.y());
    window.acceleration =
        Complex((bins[j + kReach].speed - bins[j - kReach].speed) /
                    (2.0 * kReach * MotionBins::kBinS),
                speed * window.gyroscope_yaw);
    windows.push_back(window);
  }
  return windows;
}

// Biases, tilt and extrinsics add constants: only variations are compared.
void SubtractMeans(std::vector<Window>* windows) {
  Window mean;
  double sum = 0.0;
  for (const Window& window : *windows) sum += window.weight;
  for (const Window& window : *windows) {
    const double share = window.weight / sum;
    mean.acceleration += share * window.acceleration;
    mean.force += share * window.force;
    mean.wheel_yaw += share * window.wheel_yaw;
    mean.gyroscope_yaw += share * window.gyroscope_yaw;
  }
  for (Window& window : *windows) {
    window.acceleration -= mean.acceleration;
    window.force -= mean.force;
    window.wheel_yaw -= mean.wheel_yaw;
    window.gyroscope_yaw -= mean.gyroscope_yaw;
  }
}

// Slipping wheels accelerate where the machine does not, by so much that two
// slips dominate a short log. The logged acceleration is therefore fitted to
// the force, which has no such outliers, by iteratively reweighted least
// squares (Cauchy, noise from the lowest quartile): windows far from the fit
// get low weights.
void WeighSlips(std::vector<Window>* windows) {
  for (int i = 0; i < kNumReweightings; ++i) {
    SubtractMeans(windows);
    Complex product = 0.0;
    double square = 0.0;
    for (const Window& window : *windows) {
      product += window.weight * window.acceleration * std::conj(window.force);
      square += window.weight * std::norm(window.force);
    }
    if (square <= 0.0) return;
    std::vector<double> errors;
    for (const Window& window : *windows) {
      errors.push_back(
          std::abs(window.acceleration - product / square * window.force));
    }
    std::vector<double> sorted = errors;
    const auto quarter = sorted.begin() + sorted.size() / 4;
    std::nth_element(sorted.begin(), quarter, sorted.end());
    const double limit =
        std::max(kMinSlip, kMaxSigmas / kRayleighQuarter * *quarter);
    for (size_t k = 0; k < windows->size(); ++k) {
      const double ratio = errors[k] / limit;
      (*windows)[k].weight = 1.0 / (1.0 + ratio * ratio);
    }
  }
  SubtractMeans(windows);
}

double Correlation(double product, double square1, double square2) {
  const double scale = std::sqrt(square1 * square2);
  return scale > 0.0 ? product / scale : 0.0;
}

}  // namespace

MotionBins::MotionBins(const std::vector<ImuSample>& imu,
                       const std::vector<WheelSpeed>& speeds,
                       const Eigen::Quaterniond& wheel_from_imu) {
  if (imu.empty() || speeds.empty()) return;
  const timestamp_t start =
      std::max(imu.front().timestamp_ns, speeds.front().timestamp_ns);
  const timestamp_t end =
      std::min(imu.back().timestamp_ns, speeds.back().timestamp_ns);
  if (end <= start) return;
  const double length_s = std::min(kMaxLengthS, SecondsFromNs(end - start));
  bins_.resize(static_cast<size_t>(length_s / kBinS));
  const auto find = [&](timestamp_t time_ns) -> Bin* {
    if (time_ns < start) return nullptr;
    const double index = SecondsFromNs(time_ns - start) / kBinS;
    return index < bins_.size() ? &bins_[static_cast<size_t>(index)] : nullptr;
  };
  for (const ImuSample& sample : imu) {
    Bin* bin = find(sample.timestamp_ns);
    if (bin == nullptr) continue;
    ++bin->num_imu;
    bin->rate += wheel_from_imu * sample.angular_velocity;
    bin->force += wheel_from_imu * sample.specific_force;
  }
  for (const WheelSpeed& speed : speeds) {
    Bin* bin = find(speed.timestamp_ns);
    if (bin == nullptr) continue;
    ++bin->num_wheel;
    bin->speed += speed.speed;
    bin->yaw_rate += speed.yaw_rate;
  }
  for (Bin& bin : bins_) {
    bin.rate /= std::max(1, bin.num_imu);
    bin.force /= std::max(1, bin.num_imu);
    bin.speed /= std::max(1, bin.num_wheel);
    bin.yaw_rate /= std::max(1, bin.num_wheel);
  }
}

Eigen::Vector3d MotionBins::MeanForce() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Bin& bin : bins_) {
    if (bin.num_imu == 0) continue;
    sum += bin.force;
    ++count;
  }
  return sum / std::max(1, count);
}

WheelFit FitWheels(const MotionBins& bins, const Eigen::Matrix3d& axes,
                   int shift) {
  WheelFit fit;
  std::vector<Window> windows = MakeWindows(bins, axes, shift);
  fit.num_windows = static_cast<int>(windows.size());
  if (windows.empty()) return fit;
  WeighSlips(&windows);
  Complex product = 0.0, mirrored = 0.0;
  double acceleration = 0.0, force = 0.0, forward = 0.0, forward_force = 0.0,
         forward_product = 0.0, wheel_yaw = 0.0, gyroscope_yaw = 0.0,
         yaw_product = 0.0;
  for (const Window& window : windows) {
    const double weight = window.weight;
    const Complex& a = window.acceleration;
    const Complex& f = window.force;
    fit.sum_of_weights += weight;
    product += weight * f * std::conj(a);
    mirrored += weight * f * a;
    acceleration += weight * std::norm(a);
    force += weight * std::norm(f);
    forward += weight * a.real() * a.real();
    forward_force += weight * f.real() * f.real();
    forward_product += weight * a.real() * f.real();
    wheel_yaw += weight * window.wheel_yaw * window.wheel_yaw;
    gyroscope_yaw += weight * window.gyroscope_yaw * window.gyroscope_yaw;
    yaw_product += weight * window.wheel_yaw * window.gyroscope_yaw;
  }
  if (acceleration > 0.0) fit.force = product / acceleration;
  if (gyroscope_yaw > 0.0) fit.yaw = yaw_product / gyroscope_yaw;
  fit.force_correlation = Correlation(std::abs(product), acceleration, force);
  fit.mirrored_correlation =
      Correlation(std::abs(mirrored), acceleration, force);
  fit.forward_correlation =
      Correlation(forward_product, forward, forward_force);
  fit.yaw_correlation = Correlation(yaw_product, wheel_yaw, gyroscope_yaw);
  fit.acceleration_rms = std::sqrt(acceleration / fit.sum_of_weights);
  fit.yaw_rate_rms = std::sqrt(gyroscope_yaw / fit.sum_of_weights);
  return fit;
}

}  // namespace adasfm
