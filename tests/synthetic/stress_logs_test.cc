// SPDX-License-Identifier: BSD-3-Clause
// Compares each option of hard sensor logs with the logs and their poses.

#include <gtest/gtest.h>

#include <cmath>

#include "core/so3.h"
#include "synthetic/synthetic_world.h"
#include "synthetic/world_summary.h"
#include "tests/testing/synthetic/world_properties.h"

namespace adasfm {
namespace {

SyntheticWorldOptions NoiseFreeOptions() {
  SyntheticWorldOptions options;
  options.num_keypoints_per_image = 20;
  options.imu_noise = {0.0, 0.0, 0.0, 0.0};
  options.gyro_bias_sigma = 0.0;
  options.accel_bias_sigma = 0.0;
  options.wheel_speed_noise = 0.0;
  return options;
}

TEST(StressLogs, StopsAndSpinsStandInLogsAndPoses) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 200;
  options.spacing_m = 3.0;
  options.num_stops = 1;
  options.stop_duration_s = 6.0;
  options.num_spins = 1;
  options.spin_duration_s = 5.0;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  ASSERT_EQ(world.stops.size(), 2);
  EXPECT_NEAR(SummarizeWorld(world).standing_s, 11.0, 1e-6);
  int num_spins = 0;
  for (const auto& [begin, end] : world.stops) {
    double turned = 0.0;
    for (const ImuSample& sample : world.imu_samples) {
      if (sample.timestamp_ns < begin || sample.timestamp_ns > end) continue;
      turned += sample.angular_velocity.z() / options.imu_rate_hz;
    }
    const bool is_spin = std::abs(turned) > 1.0;
    num_spins += is_spin;
    EXPECT_NEAR(std::abs(turned), is_spin ? 2.0 * kPi : 0.0, 0.02);
    double rolled = 0.0;
    for (const WheelSample& sample : world.wheel_samples) {
      if (sample.timestamp_ns < begin || sample.timestamp_ns > end) continue;
      rolled = std::max(rolled, std::abs(sample.first + sample.second));
    }
    EXPECT_LT(rolled, 1e-9);
    const SyntheticImage* last = nullptr;
    for (const SyntheticImage& image : world.images) {
      if (image.timestamp_ns < begin || image.timestamp_ns > end) continue;
      if (last != nullptr && !is_spin) {
        EXPECT_LT((Center(image) - Center(*last)).norm(), 1e-9);
      }
      last = &image;
    }
    ASSERT_NE(last, nullptr);
  }
  EXPECT_EQ(num_spins, 1);
  options.stop_duration_s = 500.0;
  EXPECT_NE(BuildError(options).find("at most"), std::string::npos);
}

// An hour at rest with an image every six minutes, in the middle of a drive
// whose other images are those of a shorter drive without a stop.
TEST(StressLogs, AStopMayLastForHours) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 30;
  const SyntheticWorld without = BuildSyntheticWorld(options);
  options.num_images = 40;
  options.imu_rate_hz = 20.0;
  options.num_stops = 1;
  options.stop_duration_s = 3600.0;
  options.stop_image_interval_s = 360.0;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  EXPECT_NEAR(SummarizeWorld(world).standing_s, 3600.0, 1e-6);
  ASSERT_EQ(world.images.size(), 40);
  ASSERT_EQ(world.stops.size(), 1);
  std::vector<Eigen::Vector3d> at_rest, under_way;
  for (const SyntheticImage& image : world.images) {
    const bool is_at_rest = image.timestamp_ns >= world.stops[0].first &&
                            image.timestamp_ns <= world.stops[0].second;
    (is_at_rest ? at_rest : under_way).push_back(Center(image));
  }
  ASSERT_EQ(at_rest.size(), 10);
  for (const Eigen::Vector3d& center : at_rest) {
    EXPECT_LT((center - at_rest.front()).norm(), 1e-9);
  }
  // The jitter of the times moves an image by 1 % of a spacing.
  for (size_t i = 0; i < under_way.size(); ++i) {
    EXPECT_LT((under_way[i] - Center(without.images[i])).norm(),
              0.05 * options.spacing_m);
  }
  double turned = 0.0;
  for (const ImuSample& sample : world.imu_samples) {
    if (sample.timestamp_ns < world.stops[0].first ||
        sample.timestamp_ns > world.stops[0].second) {
      continue;
    }
    turned += sample.angular_velocity.norm();
  }
  EXPECT_LT(turned, 1e-6);
  options.stop_image_interval_s = 60.0;
  EXPECT_NE(BuildError(options).find("at most 20"), std::string::npos);
  options.num_stops = 0;
  EXPECT_NE(BuildError(options).find("without stops"), std::string::npos);
}

TEST(StressLogs, GravelSlipsHaveTheirSigma) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 600;
  options.spacing_m = 4.0;
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.wheel_slip_sigma = 0.1;
  const SyntheticWorld gravel = BuildSyntheticWorld(options);
  double sum = 0.0;
  double product = 0.0;
  int num = 0;
  for (size_t i = 0; i < clean.wheel_samples.size(); ++i) {
    if (std::abs(clean.wheel_samples[i].first) < 0.5) continue;
    const double left =
        gravel.wheel_samples[i].first / clean.wheel_samples[i].first - 1.0;
    const double right =
        gravel.wheel_samples[i].second / clean.wheel_samples[i].second - 1.0;
    sum += left * left + right * right;
    product += left * right;
    num += 2;
  }
  // 300 s of a correlation time of 1 s and two wheels: some 300 draws.
  EXPECT_NEAR(std::sqrt(sum / num), 0.1, 0.1 * 4.0 / std::sqrt(2.0 * 300.0));
  EXPECT_LT(std::abs(product / num), 0.2 * 0.01);
}

TEST(StressLogs, GyroscopeDriftsAsAskedFor) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.gyro_drift = 2e-4;
  const SyntheticWorld drifting = BuildSyntheticWorld(options);
  const size_t last = clean.imu_samples.size() - 1;
  const Eigen::Vector3d bias = drifting.imu_samples[last].angular_velocity -
                               clean.imu_samples[last].angular_velocity;
  EXPECT_NEAR(bias.z(), 2e-4 * last / options.imu_rate_hz, 1e-9);
  EXPECT_LT(bias.head<2>().norm(), 1e-12);
}

TEST(StressLogs, RatesOfTheGyroscopeAreScaled) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.gyro_scale = 0.02;
  const SyntheticWorld scaled = BuildSyntheticWorld(options);
  double largest = 0.0;
  for (size_t i = 0; i < clean.imu_samples.size(); ++i) {
    const Eigen::Vector3d rate =
        clean.imu_samples[i].angular_velocity - clean.true_gyro_bias;
    EXPECT_LT((scaled.imu_samples[i].angular_velocity -
               clean.imu_samples[i].angular_velocity - 0.02 * rate)
                  .norm(),
              1e-12);
    largest = std::max(largest, rate.norm());
  }
  EXPECT_GT(largest, 0.1);
}

TEST(StressLogs, FixesHaveNoiseAndJumps) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 600;
  EXPECT_TRUE(BuildSyntheticWorld(options).gnss_fixes.empty());
  options.gnss_rate_hz = 5.0;
  options.gnss_noise_m = 0.0;
  const SyntheticWorld exact = BuildSyntheticWorld(options);
  // The antenna's position at an image, from the camera's pose and calibration.
  const SyntheticImage& image = exact.images[100];
  const Eigen::Vector3d antenna =
      (exact.cam_from_imu.Inverse() * image.cam_from_world).Inverse() *
      exact.antenna_in_imu;
  double nearest = 1e9;
  for (const SyntheticFix& fix : exact.gnss_fixes) {
    if (std::abs(fix.timestamp_ns - image.timestamp_ns) > 110000000) continue;
    nearest = std::min(nearest, (fix.position_in_world - antenna).norm());
  }
  EXPECT_LT(nearest, 1.0);  // 8 m/s for 0.1 s
  options.gnss_noise_m = 0.7;
  options.num_gnss_jumps = 2;
  const SyntheticWorld noisy = BuildSyntheticWorld(options);
  double sum = 0.0;
  int num_jumping = 0;
  const size_t num = exact.gnss_fixes.size();
  for (size_t i = 0; i < num; ++i) {
    const Eigen::Vector3d error = noisy.gnss_fixes[i].position_in_world -
                                  exact.gnss_fixes[i].position_in_world;
    if (error.norm() > 8.0) {
      ++num_jumping;
      EXPECT_NEAR(error.norm(), 15.0, 5.0 * 0.7);
    } else {
      sum += error.squaredNorm();
    }
  }
  EXPECT_NEAR(num_jumping, 2 * 5 * 5, 2);
  const size_t num_noisy = 3 * (num - num_jumping);
  EXPECT_NEAR(std::sqrt(sum / num_noisy), 0.7,
              0.7 * 4.0 / std::sqrt(2.0 * num_noisy));
}

}  // namespace
}  // namespace adasfm
