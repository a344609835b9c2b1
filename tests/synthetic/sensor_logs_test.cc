// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/sensor_logs.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/so3.h"
#include "synthetic/drive.h"
#include "synthetic/street_grid.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

SyntheticWorldOptions NoiseFreeOptions(uint64_t seed) {
  SyntheticWorldOptions options;
  options.seed = seed;
  options.num_images = 80;
  options.imu_noise = {0.0, 0.0, 0.0, 0.0};
  options.gyro_bias_sigma = 0.0;
  options.accel_bias_sigma = 0.0;
  options.wheel_speed_noise = 0.0;
  return options;
}

Drive MakeDrive(const SyntheticWorld& world) {
  return Drive(world.options,
               BuildPath(world.options, BuildStreetGrid(world.options).route),
               world.imu_from_wheel);
}

TEST(Drive, VelocitiesAreDerivativesOfThePose) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorldOptions options = NoiseFreeOptions(seed);
    const Drive drive(options,
                      BuildPath(options, BuildStreetGrid(options).route),
                      Rigid3d(ExpSo3(Eigen::Vector3d(0.1, -0.2, 0.3)),
                              Eigen::Vector3d(-0.4, 0.1, -0.3)));
    const double h = 1e-3;
    for (double t = 0.5; t < 20.0; t += 0.0937) {
      const DriveState state = drive.StateAt(t);
      const DriveState before = drive.StateAt(t - h);
      const DriveState after = drive.StateAt(t + h);
      const Eigen::Vector3d velocity = (after.world_from_imu.translation -
                                        before.world_from_imu.translation) /
                                       (2.0 * h);
      const Eigen::Vector3d acceleration =
          (after.velocity_in_world - before.velocity_in_world) / (2.0 * h);
      const Eigen::Vector3d angular_velocity =
          LogSo3(before.world_from_imu.rotation.conjugate() *
                 after.world_from_imu.rotation) /
          (2.0 * h);
      // Central differences are off by h^2 / 6 times a third derivative; with
      // waves of up to 20 rad/s that is below 1e-3 of the amplitude.
      EXPECT_LT((velocity - state.velocity_in_world).norm(), 1e-4);
      EXPECT_LT((acceleration - state.acceleration_in_world).norm(), 2e-3);
      EXPECT_LT((angular_velocity - state.angular_velocity_in_imu).norm(),
                2e-4);
    }
  }
}

TEST(Drive, TimeInvertsArcLength) {
  const SyntheticWorldOptions options = NoiseFreeOptions(4);
  const Drive drive(options, BuildPath(options, BuildStreetGrid(options).route),
                    Rigid3d());
  for (const double s : {0.01, 0.5, 3.0, 20.0, 47.0, 60.0, 100.0}) {
    EXPECT_NEAR(drive.ArcLengthAt(drive.TimeAt(s)), s, 1e-9);
  }
}

// Dead reckoning with the trapezoidal rule from the true start.
double DeadReckoningError(double imu_rate_hz, uint64_t seed) {
  SyntheticWorldOptions options = NoiseFreeOptions(seed);
  options.imu_rate_hz = imu_rate_hz;
  options.num_keypoints_per_image = 20;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const Drive drive = MakeDrive(world);
  Rigid3d pose = drive.StateAt(0.0).world_from_imu;
  Eigen::Vector3d velocity = drive.StateAt(0.0).velocity_in_world;
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  for (size_t i = 1; i < world.imu_samples.size(); ++i) {
    const ImuSample& a = world.imu_samples[i - 1];
    const ImuSample& b = world.imu_samples[i];
    const double dt = SecondsFromNs(b.timestamp_ns - a.timestamp_ns);
    const Eigen::Quaterniond next =
        pose.rotation *
        ExpSo3(0.5 * dt * (a.angular_velocity + b.angular_velocity));
    const Eigen::Vector3d acceleration =
        0.5 * (pose.rotation * a.specific_force + next * b.specific_force) +
        gravity;
    pose.translation += dt * velocity + 0.5 * dt * dt * acceleration;
    velocity += dt * acceleration;
    pose.rotation = next;
  }
  const double end_s =
      SecondsFromNs(world.imu_samples.back().timestamp_ns - kWorldStartNs);
  return (pose.translation - drive.StateAt(end_s).world_from_imu.translation)
      .norm();
}

TEST(SimulateImu, IntegratesToTheTrajectory) {
  for (const uint64_t seed : {1, 2, 3}) {
    const double coarse = DeadReckoningError(200.0, seed);
    const double fine = DeadReckoningError(800.0, seed);
    // Only the integrator's error is left, of second order in the step.
    EXPECT_LT(fine, 0.02);
    EXPECT_LT(fine, coarse / 10.0);
  }
}

TEST(SimulateImu, FeelsGravityAndBiasesAtRest) {
  SyntheticWorldOptions options = NoiseFreeOptions(5);
  options.gyro_bias_sigma = 0.003;
  options.accel_bias_sigma = 0.03;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const ImuSample& sample = world.imu_samples[100];
  EXPECT_LT((sample.angular_velocity - world.true_gyro_bias).norm(), 1e-12);
  EXPECT_NEAR((sample.specific_force - world.true_accel_bias).norm(), 9.81,
              1e-9);
  EXPECT_GT(sample.specific_force.z(), 9.5);
  EXPECT_GT(world.true_gyro_bias.norm(), 0.0);
}

TEST(SimulateImu, NoiseHasTheDensityAskedFor) {
  SyntheticWorldOptions options = NoiseFreeOptions(6);
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.imu_noise = {1e-3, 0.0, 2e-2, 0.0};
  const SyntheticWorld noisy = BuildSyntheticWorld(options);
  double gyro = 0.0;
  double accel = 0.0;
  const size_t num = clean.imu_samples.size();
  for (size_t i = 0; i < num; ++i) {
    const ImuSample& a = clean.imu_samples[i];
    const ImuSample& b = noisy.imu_samples[i];
    gyro += (a.angular_velocity - b.angular_velocity).squaredNorm();
    accel += (a.specific_force - b.specific_force).squaredNorm();
  }
  // Relative error of a standard deviation from 3 num draws, four sigmas.
  const double tolerance = 4.0 / std::sqrt(6.0 * num);
  EXPECT_NEAR(std::sqrt(gyro / (3 * num)) / (1e-3 * std::sqrt(200.0)), 1.0,
              tolerance);
  EXPECT_NEAR(std::sqrt(accel / (3 * num)) / (2e-2 * std::sqrt(200.0)), 1.0,
              tolerance);
}

// Integrates speed and yaw rate of the log in the plane.
struct WheelTotals {
  double length = 0.0;
  double turn = 0.0;
};
WheelTotals IntegrateWheels(const SyntheticWorld& world) {
  WheelTotals totals;
  for (size_t i = 1; i < world.wheel_samples.size(); ++i) {
    const WheelSample& a = world.wheel_samples[i - 1];
    const WheelSample& b = world.wheel_samples[i];
    const double dt = SecondsFromNs(b.timestamp_ns - a.timestamp_ns);
    totals.length += 0.25 * dt * (a.first + a.second + b.first + b.second);
    totals.turn += 0.5 * dt * (a.second - a.first + b.second - b.first) /
                   world.track_width_m;
  }
  return totals;
}

TEST(SimulateWheels, IntegrateToThePathWithScale) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options = NoiseFreeOptions(seed);
    options.wheel_scale = 1.02;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const Drive drive = MakeDrive(world);
    const double end_s =
        SecondsFromNs(world.wheel_samples.back().timestamp_ns - kWorldStartNs);
    const WheelTotals totals = IntegrateWheels(world);
    // The weave and the pitch change the length by less than 0.3 %.
    EXPECT_NEAR(options.wheel_scale * totals.length / drive.ArcLengthAt(end_s),
                1.0, 3e-3);
    const Eigen::Quaterniond turn =
        drive.StateAt(0.0).world_from_imu.rotation.conjugate() *
        drive.StateAt(end_s).world_from_imu.rotation;
    const Eigen::Vector3d forward = turn * Eigen::Vector3d::UnitX();
    const double yaw = std::atan2(forward.y(), forward.x());
    EXPECT_NEAR(
        std::remainder(options.wheel_scale * totals.turn - yaw, 2.0 * kPi), 0.0,
        0.01);
  }
}

TEST(SimulateWheels, SlipsAreLoggedTooFastAndRecorded) {
  SyntheticWorldOptions options = NoiseFreeOptions(7);
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.num_wheel_slips = 3;
  options.timeshift_cam_imu_s = 0.25;
  const SyntheticWorld slipping = BuildSyntheticWorld(options);
  ASSERT_EQ(slipping.wheel_slips.size(), 3);
  int num_slipping = 0;
  for (size_t i = 0; i < clean.wheel_samples.size(); ++i) {
    const timestamp_t camera_ns =
        slipping.wheel_samples[i].timestamp_ns - 250000000;
    bool in_slip = false;
    for (const auto& [begin, end] : slipping.wheel_slips) {
      in_slip = in_slip || (camera_ns >= begin && camera_ns < end);
    }
    num_slipping += in_slip;
    const double ratio =
        clean.wheel_samples[i].first == 0.0
            ? 1.0
            : slipping.wheel_samples[i].first / clean.wheel_samples[i].first;
    EXPECT_EQ(ratio > 1.2, in_slip);
  }
  EXPECT_GE(num_slipping, 3 * 25 - 3);
}

TEST(SimulateWheels, RestIsExactlyZero) {
  SyntheticWorldOptions options = NoiseFreeOptions(8);
  options.wheel_speed_noise = 0.05;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(world.wheel_samples[i].first, 0.0);
    EXPECT_EQ(world.wheel_samples[i].second, 0.0);
  }
}

}  // namespace
}  // namespace adasfm
