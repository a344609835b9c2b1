// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/preintegration/wheel_odometry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// An arc at constant speed and yaw rate.
std::vector<WheelSpeed> Arc(double speed, double yaw_rate, int num = 51) {
  std::vector<WheelSpeed> speeds;
  for (int i = 0; i < num; ++i) {
    speeds.push_back({timestamp_t{20'000'000} * i, speed, yaw_rate});
  }
  return speeds;
}

TEST(PreintegrateWheel, DrivesAnArc) {
  const double speed = 5.0, yaw_rate = 0.7, time = 0.913;
  const WheelMotion motion =
      PreintegrateWheel(Arc(speed, yaw_rate), 0, 913'000'000,
                        Eigen::Quaterniond::Identity(), WheelNoise(), {});
  const double angle = yaw_rate * time, radius = speed / yaw_rate;
  const Eigen::Vector3d expected(radius * std::sin(angle),
                                 radius * (1.0 - std::cos(angle)), 0.0);
  EXPECT_LT(
      (motion.displacement_map * Eigen::Vector3d::UnitX() - expected).norm(),
      1e-4);
  EXPECT_NEAR(motion.distance_m, speed * time, 1e-9);
  EXPECT_NEAR(motion.yaw_rad, angle, 1e-9);
}

TEST(PreintegrateWheel, FollowsTheProfileOfTheGyroscope) {
  // Only the gyroscope measures yaw, about an axis of its own frame.
  const Eigen::Quaterniond imu_from_wheel =
      ExpSo3(Eigen::Vector3d(0.1, 0.2, 1.0));
  const Eigen::Vector3d rate = imu_from_wheel * Eigen::Vector3d(0, 0, 0.7);
  std::vector<RotationAtTime> profile;
  for (int i = 0; i <= 200; ++i) {
    profile.push_back({timestamp_t{5'000'000} * i, ExpSo3(rate * 0.005 * i)});
  }
  const WheelMotion with_gyro = PreintegrateWheel(
      Arc(5.0, 0.0), 0, 1'000'000'000, imu_from_wheel, WheelNoise(), profile);
  const WheelMotion with_yaw = PreintegrateWheel(
      Arc(5.0, 0.7), 0, 1'000'000'000, imu_from_wheel, WheelNoise(), {});
  EXPECT_LT((with_gyro.displacement_map - with_yaw.displacement_map).norm(),
            1e-3);
}

// The moment is the derivative of the displacement by the rotation at the end.
TEST(PreintegrateWheel, RotationMomentMatchesNumericDerivative) {
  const auto integrate = [](const Eigen::Vector3d& rate) {
    std::vector<RotationAtTime> profile;
    for (int i = 0; i <= 200; ++i) {
      profile.push_back({timestamp_t{5'000'000} * i, ExpSo3(rate * 0.005 * i)});
    }
    return PreintegrateWheel(Arc(5.0, 0.0), 0, 1'000'000'000,
                             Eigen::Quaterniond::Identity(), WheelNoise(),
                             profile);
  };
  const Eigen::Vector3d rate(0.05, -0.1, 0.3);
  const Eigen::Vector3d forward = Eigen::Vector3d::UnitX();
  const WheelMotion motion = integrate(rate);
  constexpr double kStep = 1e-5;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d delta = kStep * Eigen::Vector3d::Unit(axis);
    const WheelMotion plus = integrate(rate + delta);
    const Eigen::Vector3d numeric =
        (plus.displacement_map - motion.displacement_map) * forward / kStep;
    const Eigen::Vector3d phi =
        LogSo3(motion.profile_rotation.conjugate() * plus.profile_rotation) /
        kStep;
    const Eigen::Vector3d moment = motion.rotation_moment * phi.cross(forward);
    // The moment assumes that phi grows in proportion to time: true up to a
    // share of the rotation (0.3 rad / 6), here of 5 m * 0.5.
    EXPECT_LT((numeric - moment).norm(), 0.3 / 6.0 * 2.5 + 0.02);
  }
}

TEST(PreintegrateWheel, CovarianceMatchesMonteCarlo) {
  const double sample_sigma = 0.05, rate_hz = 50.0;
  WheelNoise noise;
  noise.forward = sample_sigma / std::sqrt(rate_hz);
  noise.yaw_rate = 0.01 / std::sqrt(rate_hz);
  Random random(4);
  double forward = 0.0, yaw = 0.0;
  constexpr int kNumRuns = 2000;
  WheelMotion motion;
  for (int run = 0; run < kNumRuns; ++run) {
    std::vector<WheelSpeed> speeds = Arc(5.0, 0.0);
    for (WheelSpeed& speed : speeds) {
      speed.speed += random.Gaussian(sample_sigma);
      speed.yaw_rate += random.Gaussian(0.01);
    }
    motion = PreintegrateWheel(speeds, 0, 1'000'000'000,
                               Eigen::Quaterniond::Identity(), noise, {});
    forward += std::pow(motion.distance_m - 5.0, 2) / kNumRuns;
    yaw += motion.yaw_rad * motion.yaw_rad / kNumRuns;
  }
  // 5 sigma of a variance's estimate, and the ends' half samples.
  const double tolerance = 5.0 * std::sqrt(2.0 / kNumRuns) + 0.02;
  EXPECT_NEAR(forward / motion.covariance(0, 0), 1.0, tolerance);
  EXPECT_NEAR(yaw / motion.yaw_variance, 1.0, tolerance);
}

TEST(ComputeWheelSpeeds, KnowsAllTypes) {
  SensorCalibration calibration;
  calibration.track_width_m = 1.2;
  const std::vector<WheelSample> samples = {{0, 1.0, 1.6},
                                            {100'000'000, 2.0, 2.6}};
  calibration.wheel_type = WheelType::kDifferential;
  std::vector<WheelSpeed> speeds = ComputeWheelSpeeds(samples, calibration);
  EXPECT_NEAR(speeds[0].speed, 1.3, 1e-12);
  EXPECT_NEAR(speeds[0].yaw_rate, 0.5, 1e-12);
  calibration.wheel_type = WheelType::kVelocity;
  speeds = ComputeWheelSpeeds(samples, calibration);
  EXPECT_EQ(speeds[1].speed, 2.0);
  EXPECT_EQ(speeds[1].yaw_rate, 2.6);
  calibration.wheel_type = WheelType::kSpeed;
  speeds = ComputeWheelSpeeds(samples, calibration);
  EXPECT_EQ(speeds[1].speed, 2.0);
  EXPECT_EQ(speeds[1].yaw_rate, 0.0);
}

TEST(ComputeWheelSpeeds, TicksAreSpeedsBetweenCounts) {
  SensorCalibration calibration;
  calibration.wheel_type = WheelType::kTicks;
  calibration.track_width_m = 1.0;
  calibration.metres_per_tick = 0.001;
  const std::vector<WheelSpeed> speeds = ComputeWheelSpeeds(
      {{0, 1000, 2000}, {100'000'000, 1100, 2120}}, calibration);
  ASSERT_EQ(speeds.size(), 1u);
  EXPECT_EQ(speeds[0].timestamp_ns, 50'000'000);
  EXPECT_NEAR(speeds[0].speed, 1.1, 1e-9);
  EXPECT_NEAR(speeds[0].yaw_rate, 0.2, 1e-9);
}

// Counters round once at each end of an interval, whatever lies in between:
// coarse ticks are no noise of the speed. Errors of single intervals, also of
// those that begin or end between counts, must agree with the stated variances.
TEST(PreintegrateWheel, CountersRoundOnceAtEachEnd) {
  SensorCalibration calibration;
  calibration.wheel_type = WheelType::kTicks;
  calibration.track_width_m = 1.0;
  calibration.metres_per_tick = 0.05;
  WheelNoise noise;
  noise.forward = noise.lateral = noise.vertical = noise.yaw_rate = 0.0;
  noise.distance_rounding = calibration.metres_per_tick / std::sqrt(12.0);
  noise.yaw_rounding = calibration.metres_per_tick / std::sqrt(3.0);
  constexpr int kNumRuns = 1000;
  for (const double seconds : {0.2, 1.5}) {
    Random random(7);
    double distance = 0.0, yaw = 0.0;
    WheelMotion motion;
    for (int run = 0; run < kNumRuns; ++run) {
      const double speed = random.Uniform(1.0, 8.0);
      const double phases[] = {random.Uniform(0.0, 1.0),
                               random.Uniform(0.0, 1.0)};
      std::vector<WheelSample> samples;
      for (int k = 0; k <= 100; ++k) {
        const double ticks = 0.02 * k * speed / calibration.metres_per_tick;
        samples.push_back({k * timestamp_t(20'000'000),
                           std::floor(ticks + phases[0]),
                           std::floor(ticks + phases[1])});
      }
      const double begin = random.Uniform(0.1, 0.3);
      const auto begin_ns = static_cast<timestamp_t>(1e9 * begin);
      const auto end_ns = static_cast<timestamp_t>(1e9 * (begin + seconds));
      motion =
          PreintegrateWheel(ComputeWheelSpeeds(samples, calibration), begin_ns,
                            end_ns, Eigen::Quaterniond::Identity(), noise, {});
      distance += std::pow(motion.distance_m - seconds * speed, 2) / kNumRuns;
      yaw += motion.yaw_rad * motion.yaw_rad / kNumRuns;
    }
    // Between counts speeds are averaged: the errors are somewhat smaller.
    EXPECT_LT(distance, 1.2 * motion.covariance(0, 0)) << seconds;
    EXPECT_GT(distance, 0.2 * motion.covariance(0, 0)) << seconds;
    EXPECT_LT(yaw, 1.2 * motion.yaw_variance) << seconds;
    EXPECT_GT(yaw, 0.2 * motion.yaw_variance) << seconds;
  }
}

}  // namespace
}  // namespace adasfm
