// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/noise_figures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/io/format_figures.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

constexpr double kRateHz = 200.0;

ImuNoise RaiseToLog(const std::vector<ImuSample>& samples,
                    const ImuNoise& stated) {
  MotionLogs logs;
  logs.imu = samples;
  SensorCalibration calibration;
  calibration.imu_noise = stated;
  std::vector<std::string> warnings;
  RaiseNoiseFigures(logs, &calibration, &warnings);
  return calibration.imu_noise;
}

// White noise of the given densities on a motion that turns and accelerates.
std::vector<ImuSample> Samples(const ImuNoise& noise, uint64_t seed,
                               double vibration = 0.0, double lag_s = 0.0) {
  Random random(seed);
  std::vector<ImuSample> samples;
  Eigen::Vector3d filtered = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4000; ++i) {
    const double time_s = i / kRateHz;
    ImuSample sample;
    sample.timestamp_ns = std::llround(1e9 * time_s);
    sample.angular_velocity =
        Eigen::Vector3d(0.0, 0.1, 0.5) * std::sin(kPi * time_s) +
        Eigen::Vector3d::Constant(vibration *
                                  std::sin(2.0 * kPi * 61.0 * time_s)) +
        random.GaussianVector(noise.gyroscope_noise_density *
                              std::sqrt(kRateHz));
    filtered += (sample.angular_velocity - filtered) *
                (lag_s > 0.0 ? 1.0 / (kRateHz * lag_s) : 1.0);
    sample.angular_velocity = filtered;
    sample.specific_force =
        Eigen::Vector3d(2.0 * std::cos(kPi * time_s), 0.0, 9.81) +
        random.GaussianVector(noise.accelerometer_noise_density *
                              std::sqrt(kRateHz));
    samples.push_back(sample);
  }
  return samples;
}

// Second differences of 20 s at 200 Hz determine a density to 2 %. A quarter of
// the stretches and the least of three estimates are a little below it.
TEST(NoiseFigures, AFigureThatIsTooSmallIsRaisedToTheLog) {
  const ImuNoise truth;
  ImuNoise stated = truth;
  stated.gyroscope_noise_density /= 3.0;
  stated.accelerometer_noise_density /= 3.0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const ImuNoise noise = RaiseToLog(Samples(truth, seed), stated);
    EXPECT_NEAR(noise.gyroscope_noise_density / truth.gyroscope_noise_density,
                1.0, 0.12);
    EXPECT_NEAR(
        noise.accelerometer_noise_density / truth.accelerometer_noise_density,
        1.0, 0.12);
    EXPECT_EQ(noise.gyroscope_random_walk, stated.gyroscope_random_walk);
  }
}

TEST(NoiseFigures, RightAndLargeFiguresAreKept) {
  const ImuNoise truth;
  for (const double factor : {1.0, 3.0}) {
    ImuNoise stated = truth;
    stated.gyroscope_noise_density *= factor;
    stated.accelerometer_noise_density *= factor;
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      const ImuNoise noise = RaiseToLog(Samples(truth, seed), stated);
      EXPECT_EQ(noise.gyroscope_noise_density, stated.gyroscope_noise_density);
      EXPECT_EQ(noise.accelerometer_noise_density,
                stated.accelerometer_noise_density);
    }
  }
}

// Vibration is motion at one frequency, white noise is at all frequencies.
// Differences of neighbouring samples would state the vibration as 3e-3
// rad/s/sqrt(Hz).
TEST(NoiseFigures, VibrationIsNoNoise) {
  const ImuNoise truth;
  const ImuNoise noise = RaiseToLog(Samples(truth, 1, 0.05), truth);
  EXPECT_LT(noise.gyroscope_noise_density, 1.5 * truth.gyroscope_noise_density);
}

// Neighbours in a filtered log differ little, which is not small noise.
TEST(NoiseFigures, AFilteredLogIsNotBelieved) {
  const ImuNoise truth;
  const ImuNoise noise = RaiseToLog(Samples(truth, 1, 0.0, 0.05), truth);
  EXPECT_EQ(noise.gyroscope_noise_density, truth.gyroscope_noise_density);
}

TEST(NoiseFigures, AShortLogChangesNothing) {
  std::vector<ImuSample> samples = Samples(ImuNoise(), 1);
  ImuNoise stated;
  stated.gyroscope_noise_density = 1e-6;
  samples.resize(800);
  EXPECT_EQ(RaiseToLog(samples, stated).gyroscope_noise_density, 1e-6);
  EXPECT_EQ(RaiseToLog({}, stated).gyroscope_noise_density, 1e-6);
}

TEST(NoiseFigures, FarTooSmallOnesAreSaid) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(1)));
  const double truth = data.calibration.imu_noise.gyroscope_noise_density;
  data.calibration.imu_noise.gyroscope_noise_density /= 100.0;
  data.calibration.imu_noise.accelerometer_noise_density /= 100.0;
  data.calibration.wheel_speed_noise /= 100.0;
  const MotionLogs logs = {
      data.logs.imu,
      ComputeWheelSpeeds(data.logs.wheel, data.calibration),
      {},
      {},
      {}};
  std::vector<std::string> warnings;
  RaiseNoiseFigures(logs, &data.calibration, &warnings);
  EXPECT_EQ(warnings.size(), 3u);
  EXPECT_NEAR(data.calibration.imu_noise.gyroscope_noise_density, truth,
              0.2 * truth);
  EXPECT_NEAR(data.calibration.wheel_speed_noise, 0.05, 0.02);
}

// Rates about one axis that oscillate at five frequencies for 20 s, then rest.
struct Swinging {
  double highest_hz = 0.0;

  double Rate(double time_s) const {
    const double envelope = std::max(0.0, std::sin(2.0 * kPi * time_s / 40.0));
    double rate = 0.0;
    for (int i = 1; i <= 5; ++i) {
      rate += std::cos(2.0 * kPi * highest_hz * std::sqrt(i / 5.0) * time_s +
                       i * i);
    }
    return 0.5 * envelope * envelope * rate;
  }

  // The angle of rotation over a second.
  double Angle(double begin_s) const {
    constexpr int kNumSteps = 2000;
    double angle = 0.0;
    for (int i = 0; i < kNumSteps; ++i) {
      angle += Rate(begin_s + (i + 0.5) / kNumSteps) / kNumSteps;
    }
    return angle;
  }

  std::vector<ImuSample> Samples(int rate_hz) const {
    Random random(3);
    std::vector<ImuSample> samples;
    for (int i = 0; i < 40 * rate_hz; ++i) {
      const double time_s = static_cast<double>(i) / rate_hz;
      ImuSample sample;
      sample.timestamp_ns = std::llround(1e9 * time_s);
      sample.angular_velocity =
          Eigen::Vector3d(0.0, 0.0, Rate(time_s)) + random.GaussianVector(1e-4);
      sample.specific_force =
          Eigen::Vector3d(0.0, 0.0, 9.81) + random.GaussianVector(1e-3);
      samples.push_back(sample);
    }
    return samples;
  }

  // Trapezoidal error of a second, as the noise density of each axis.
  double Loss(const std::vector<ImuSample>& samples, int rate_hz) const {
    double sum = 0.0;
    for (int second = 0; second < 39; ++second) {
      double angle = 0.0;
      for (int k = second * rate_hz; k < (second + 1) * rate_hz; ++k) {
        angle += 0.5 / rate_hz *
                 (samples[k].angular_velocity.z() +
                  samples[k + 1].angular_velocity.z());
      }
      const double error = angle - Angle(second);
      sum += error * error / 3.0;
    }
    return std::sqrt(sum / 39.0);
  }
};

TEST(NoiseFigures, WhatAGyroscopeMissesBetweenItsSamplesIsAdded) {
  ImuNoise stated;
  stated.gyroscope_noise_density = 2e-4;
  struct Case {
    double highest_hz;
    int rate_hz;
    bool is_slow;
  };
  for (const Case& c : std::vector<Case>{{0.5, 25, false},
                                         {5.0, 200, false},
                                         {3.0, 50, false},
                                         {5.0, 50, true},
                                         {12.0, 50, true},
                                         {1.2, 10, true}}) {
    const Swinging motion = {c.highest_hz};
    const std::vector<ImuSample> samples = motion.Samples(c.rate_hz);
    const double density = RaiseToLog(samples, stated).gyroscope_noise_density;
    const double loss = motion.Loss(samples, c.rate_hz);
    SCOPED_TRACE(FormatFigures("%g Hz at %g Hz", c.highest_hz, c.rate_hz) +
                 FormatFigures(": loss %g, density %g", loss, density));
    EXPECT_EQ(density > stated.gyroscope_noise_density, c.is_slow);
    EXPECT_LT(loss, 1.2 * density);
    EXPECT_TRUE(!c.is_slow || density < 1.5 * loss);
  }
}

TEST(NoiseFigures, RightOnesOfRealLogsAreNotAccused) {
  for (const char* name :
       {"", "kitti01-51", "kitti06-51", "kitti07-160", "comma2k19-ex1"}) {
    Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(1)));
    if (name[0] != '\0' && !ReadDataset(name, &data)) continue;
    const MotionLogs logs = {
        data.logs.imu,
        ComputeWheelSpeeds(data.logs.wheel, data.calibration),
        {},
        {},
        {}};
    std::vector<std::string> warnings;
    RaiseNoiseFigures(logs, &data.calibration, &warnings);
    EXPECT_TRUE(warnings.empty()) << name << ": " << warnings.front();
  }
}

}  // namespace
}  // namespace adasfm
