// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/gyroscope_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/calibration_check/check_against_vision.h"

namespace adasfm {
namespace {

constexpr double kPi = 3.141592653589793;

// Rotations at six frequencies about random axes: slow bends and a car's
// springs. The response of a first-order low-pass filter to a sine is known.
class Wobble {
 public:
  explicit Wobble(uint64_t seed) : random_(seed) {
    for (Wave& wave : waves_) {
      wave.frequency = 2.0 * kPi * random_.Uniform(0.1, 2.5);
      wave.phase = random_.Uniform(0.0, 2.0 * kPi);
      wave.amplitude = random_.GaussianVector(0.03);
    }
  }

  // The filtered rate, rad/s.
  Eigen::Vector3d Rate(double time_s, const GyroscopeFilter& filter) const {
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();
    for (const Wave& wave : waves_) {
      const double lag = wave.frequency * filter.lag_s;
      rate += wave.amplitude / std::hypot(1.0, lag) *
              std::sin(wave.frequency * (time_s - filter.delay_s) + wave.phase -
                       std::atan(lag));
    }
    return rate;
  }

  std::vector<ImuSample> Log(const GyroscopeFilter& filter, double noise) {
    std::vector<ImuSample> log;
    for (int i = 0; i <= 2000; ++i) {
      ImuSample sample;
      sample.timestamp_ns = 10'000'000LL * i;
      sample.angular_velocity =
          Rate(0.01 * i, filter) + random_.GaussianVector(noise);
      log.push_back(sample);
    }
    return log;
  }

  // Ten images a second from 1 s to 19 s, each paired with the next two.
  std::vector<TimedRotation> Vision(double sigma_rad) {
    std::vector<Eigen::Quaterniond> world_from_camera(
        181, Eigen::Quaterniond::Identity());
    for (int i = 1; i <= 180; ++i) {
      world_from_camera[i] = world_from_camera[i - 1];
      for (int step = 0; step < 20; ++step) {
        const double time = 1.0 + 0.1 * (i - 1) + 0.005 * (step + 0.5);
        world_from_camera[i] =
            world_from_camera[i] * ExpSo3(0.005 * Rate(time, {}));
      }
    }
    std::vector<TimedRotation> rotations;
    for (int i = 0; i <= 180; ++i) {
      for (int j = i + 1; j <= std::min(180, i + 2); ++j) {
        TimedRotation rotation;
        rotation.start_ns = 1'000'000'000LL + 100'000'000LL * i;
        rotation.end_ns = 1'000'000'000LL + 100'000'000LL * j;
        rotation.cam2_from_cam1 =
            ExpSo3(random_.GaussianVector(sigma_rad)) *
            (world_from_camera[j].conjugate() * world_from_camera[i]);
        rotations.push_back(rotation);
      }
    }
    return rotations;
  }

 private:
  struct Wave {
    double frequency, phase;
    Eigen::Vector3d amplitude;
  };
  Random random_;
  Wave waves_[6];
};

TEST(GyroscopeFilter, IsUndone) {
  for (const uint64_t seed : {1, 2, 3}) {
    Wobble wobble(seed);
    const GyroscopeFilter filter = {0.05, 0.02};
    std::vector<ImuSample> log = wobble.Log(filter, 0.0);
    UndoGyroscopeFilter(filter, &log);
    for (size_t i = 100; i + 100 < log.size(); ++i) {
      const Eigen::Vector3d truth = wobble.Rate(0.01 * i, {});
      // Second order in 10 ms: 0.4 % of the derivative at 2.5 Hz.
      EXPECT_LT((log[i].angular_velocity - truth).norm(), 1e-3);
    }
  }
}

TEST(GyroscopeFilter, KeepsTimesForcesAndShortLogs) {
  std::vector<ImuSample> log(1);
  log[0].angular_velocity = Eigen::Vector3d(1, 2, 3);
  UndoGyroscopeFilter({0.05, 0.02}, &log);
  EXPECT_EQ(log[0].angular_velocity, Eigen::Vector3d(1, 2, 3));
  log.push_back(log[0]);
  log[1].timestamp_ns = 5;
  log[1].specific_force = Eigen::Vector3d(0, 0, 9.81);
  UndoGyroscopeFilter({0.05, -7.0}, &log);
  EXPECT_EQ(log[1].timestamp_ns, 5);
  EXPECT_EQ(log[1].specific_force, Eigen::Vector3d(0, 0, 9.81));
  EXPECT_EQ(log[1].angular_velocity, Eigen::Vector3d(1, 2, 3));
}

// Over ten drives: the filter's time constant and its delay of slow rotations.
TEST(GyroscopeFilter, IsFoundFromVision) {
  const GyroscopeFilter filter = {0.05, 0.02};
  constexpr int kNumSeeds = 10;
  double lags = 0.0, squares = 0.0;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    Wobble wobble(seed);
    const std::vector<TimedRotation> vision = wobble.Vision(2e-4);
    const VisionCheck check = CheckAgainstVision(
        vision, wobble.Log(filter, 1e-3), SensorCalibration());
    ASSERT_GT(check.filter.lag_s, 0.0) << "seed " << seed;
    const double lag_error = check.filter.lag_s - filter.lag_s;
    lags += lag_error;
    squares += lag_error * lag_error;
    EXPECT_NEAR(check.time_shift_correction_s + check.filter.delay_s +
                    check.filter.lag_s,
                filter.delay_s + filter.lag_s, 0.01);
  }
  const double rms = std::sqrt(squares / kNumSeeds);
  EXPECT_LT(rms, 0.01);
  // The search has a resolution of a millisecond.
  EXPECT_LT(std::abs(lags / kNumSeeds),
            1e-3 + 3.0 * rms / std::sqrt(kNumSeeds));
  RecordProperty("lag_rms_ms", std::to_string(1e3 * rms));
}

// Neither a time offset nor a slightly wrong T_cam_imu is taken for a filter.
TEST(GyroscopeFilter, IsNotFoundWhereThereIsNone) {
  for (int seed = 1; seed <= 10; ++seed) {
    Wobble wobble(seed);
    Random random(100 + seed);
    SensorCalibration calibration;
    calibration.cam_from_imu.rotation =
        ExpSo3(random.GaussianVector(DegToRad(0.5)));
    const std::vector<TimedRotation> vision = wobble.Vision(2e-4);
    const VisionCheck check =
        CheckAgainstVision(vision, wobble.Log({0.0, 0.025}, 1e-3), calibration);
    EXPECT_TRUE(check.is_conclusive);
    EXPECT_NEAR(check.time_shift_correction_s, 0.025, 0.003);
    EXPECT_EQ(check.filter.lag_s, 0.0) << "seed " << seed;
  }
}

}  // namespace
}  // namespace adasfm
