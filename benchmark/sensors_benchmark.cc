// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <cmath>
#include <stdexcept>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/estimate_priors.h"

namespace adasfm {
namespace {

// A machine at 8 m/s on a winding road: images at 10 Hz, IMU at 200 Hz, wheels
// at 50 Hz, in closed form, so that logs of any length are made in seconds.
struct LongDrive {
  explicit LongDrive(int num_images) {
    constexpr double kSpeed = 8.0;
    Random random(1);
    const double end_s = 0.1 * num_images + 1.0;
    const auto yaw_rate = [](double t) { return 0.2 * std::sin(0.3 * t); };
    calibration.has_imu = calibration.has_wheel = true;
    calibration.wheel_type = WheelType::kVelocity;
    calibration.imu_noise = {5e-4, 2e-5, 5e-3, 2e-4};
    for (int64_t i = 0; i < std::llround(200.0 * end_s); ++i) {
      const double t = i / 200.0;
      ImuSample sample;
      sample.timestamp_ns = 5'000'000 * i;
      sample.angular_velocity =
          Eigen::Vector3d(0.0, 0.0, yaw_rate(t)) + random.GaussianVector(0.007);
      sample.specific_force = Eigen::Vector3d(0.0, kSpeed * yaw_rate(t), 9.81) +
                              random.GaussianVector(0.07);
      logs.imu.push_back(sample);
    }
    for (int64_t i = 0; i < std::llround(50.0 * end_s); ++i) {
      logs.wheel.push_back({20'000'000 * i, kSpeed + random.Gaussian(0.05),
                            yaw_rate(i / 50.0) + random.Gaussian(0.02)});
    }
    for (int i = 0; i < num_images; ++i) {
      images.push_back({static_cast<image_t>(i + 1), "",
                        timestamp_t{100'000'000} * i + 500'000'000});
    }
  }

  SensorCalibration calibration;
  SensorLogs logs;
  std::vector<ImageStamp> images;
};

void BM_EstimatePriors(benchmark::State& state) {
  const LongDrive drive(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(drive.images, drive.logs, drive.calibration, {}, {});
    if (!estimate.ok()) throw std::runtime_error(estimate.status().message());
    benchmark::DoNotOptimize(estimate->priors.data());
  }
  state.SetComplexityN(state.range(0));
  state.counters["images/s"] = benchmark::Counter(
      static_cast<double>(state.range(0) * state.iterations()),
      benchmark::Counter::kIsRate);
}
BENCHMARK(BM_EstimatePriors)
    ->Arg(1000)
    ->Arg(10000)
    ->Arg(100000)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->Complexity(benchmark::oN);

void BM_PreintegrateImu(benchmark::State& state) {
  const LongDrive drive(100);
  for (auto _ : state) {
    benchmark::DoNotOptimize(PreintegrateImu(drive.logs.imu, 1'000'000'000,
                                             1'100'000'000, ImuBias(),
                                             drive.calibration.imu_noise));
  }
}
BENCHMARK(BM_PreintegrateImu);

}  // namespace
}  // namespace adasfm
