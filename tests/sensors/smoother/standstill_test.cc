// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/standstill.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/timed_rotations.h"

namespace adasfm {
namespace {

constexpr double kRateHz = 200.0;
constexpr double kLinkS = 0.5;

// A machine at rest with a yaw rate of its own, in links of half a second.
struct Rest {
  Rest(double duration_s, uint64_t seed,
       const std::function<double(double)>& yaw_rate,
       const MotionLogs& other_logs = {})
      : logs(other_logs) {
    Random random(seed);
    for (int i = 0; i <= std::lround(duration_s * kRateHz); ++i) {
      const double time_s = i / kRateHz;
      ImuSample sample;
      sample.timestamp_ns = std::llround(1e9 * time_s);
      sample.angular_velocity =
          Eigen::Vector3d(0.002, -0.001, 0.003 + yaw_rate(time_s)) +
          random.GaussianVector(noise.gyroscope_noise_density *
                                std::sqrt(kRateHz));
      sample.specific_force =
          Eigen::Vector3d(0.0, 0.0, 9.81) +
          random.GaussianVector(noise.accelerometer_noise_density *
                                std::sqrt(kRateHz));
      logs.imu.push_back(sample);
    }
    const int num_links = static_cast<int>(duration_s / kLinkS);
    for (int k = 0; k <= num_links; ++k) {
      times_ns.push_back(std::llround(1e9 * kLinkS * k));
    }
    links.resize(num_links);
    for (int k = 0; k < num_links; ++k) {
      links[k].dt_s = kLinkS;
      links[k].has_imu = true;
      links[k].imu = PreintegrateImu(logs.imu, times_ns[k], times_ns[k + 1],
                                     ImuBias(), noise);
    }
    MarkStandstills(times_ns, logs, noise, &links);
  }

  // 1 sigma of the mean yaw rate, as the links state it.
  double StatedSigma() const {
    double time = 0.0;
    for (const OdometryLink& link : links) {
      if (link.standstill != StandstillKind::kNone) time += link.dt_s;
    }
    return std::hypot(noise.gyroscope_noise_density,
                      links.front().standstill_rate_density.z()) /
           std::sqrt(time);
  }

  ImuNoise noise = {5e-4, 2e-5, 5e-3, 2e-4};
  MotionLogs logs;
  std::vector<timestamp_t> times_ns;
  std::vector<OdometryLink> links;
};

TEST(Standstill, AQuietMachineKeepsItsLinks) {
  double density = 0.0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Rest rest(5.0, seed, [](double) { return 0.0; });
    for (const OdometryLink& link : rest.links) {
      EXPECT_EQ(link.standstill, StandstillKind::kAtRest);
      EXPECT_EQ(link.standstill_time_s, 5.0);
    }
    density += rest.links[0].standstill_rate_density.z() / 20.0;
  }
  // By chance some estimates of the spectrum exceed white noise.
  EXPECT_LT(density, 5e-4);
}

// A link whose mean rotates by 6 sigma is excluded, the others are kept.
TEST(Standstill, ALinkThatTurnsIsTakenOut) {
  const Rest rest(5.0, 1, [](double time_s) {
    return time_s >= 3.0 && time_s < 3.5 ? 0.0045 : 0.0;
  });
  for (size_t k = 0; k < rest.links.size(); ++k) {
    EXPECT_EQ(rest.links[k].standstill,
              k == 6 ? StandstillKind::kNone : StandstillKind::kAtRest)
        << "link " << k;
  }
}

// Yaw rates with a correlation time of a quarter of a second: the variance of
// their mean over 20 s is five times that of white noise. The stated variance
// is right to a factor of 1.5 (blocks of seconds miss a little of it).
TEST(Standstill, SlowMotionWidensTheMean) {
  double chi2 = 0.0, chi2_white = 0.0;
  constexpr int kNumSeeds = 100;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    Random random(100 + seed);
    constexpr double kMemoryS = 0.25, kSigma = 1.4e-3;
    const double keep = std::exp(-1.0 / (kMemoryS * kRateHz));
    double rate = random.Gaussian(kSigma), sum = 0.0;
    const Rest rest(20.0, seed, [&](double) {
      rate = keep * rate + random.Gaussian(kSigma * std::sqrt(1 - keep * keep));
      sum += rate;
      return rate;
    });
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double time = 0.0;
    for (const OdometryLink& link : rest.links) {
      if (link.standstill == StandstillKind::kNone) continue;
      mean += LogSo3(link.imu.delta_rotation);
      time += link.dt_s;
    }
    const double error = mean.z() / time - 0.003;
    chi2 += std::pow(error / rest.StatedSigma(), 2) / kNumSeeds;
    chi2_white += std::pow(error / rest.noise.gyroscope_noise_density, 2) *
                  time / kNumSeeds;
  }
  std::printf("chi2 %.2f, as white noise %.2f\n", chi2, chi2_white);
  // The mean of the seeds is known to 3 sqrt(2 / 100) of itself.
  EXPECT_LT(chi2, 1.5 * 1.42);
  EXPECT_GT(chi2, 0.58 / 1.5);
  EXPECT_GT(chi2_white, 5.0 * 0.58);
}

// An IMU cannot distinguish gliding from rest; cameras can.
TEST(Standstill, CamerasThatSeeMotionOutvoteAQuietImu) {
  MotionLogs logs;
  logs.seen_moving_ns = {{2'000'000'000, 4'000'000'000},
                         {4'000'000'000, 5'900'000'000}};
  const auto still = [](double) { return 0.0; };
  const Rest moving(10.0, 1, still, logs);
  for (size_t k = 0; k < moving.links.size(); ++k) {
    const bool is_seen = k >= 4 && k < 12;
    EXPECT_EQ(moving.links[k].standstill == StandstillKind::kNone, is_seen)
        << k;
  }
  // Wheels outweigh cameras, which may see passing cars.
  for (timestamp_t time_ns = 0; time_ns <= 10'000'000'000;
       time_ns += 20'000'000) {
    logs.wheel.push_back({time_ns, 0.0, 0.0});
  }
  const Rest standing(10.0, 1, still, logs);
  for (const OdometryLink& link : standing.links) {
    EXPECT_EQ(link.standstill, StandstillKind::kAtRest);
  }
}

std::vector<std::pair<double, double>> ParkedSeconds(const Rest& rest) {
  std::vector<std::pair<double, double>> seconds;
  for (const auto& [start_ns, end_ns] :
       FindParkedIntervals(rest.logs, rest.noise)) {
    seconds.emplace_back(SecondsFromNs(start_ns), SecondsFromNs(end_ns));
  }
  return seconds;
}

TEST(FindParkedIntervals, AreStandstillsWithoutTheirEnds) {
  const auto still = [](double) { return 0.0; };
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const auto parked = ParkedSeconds(Rest(150.0, seed, still));
    ASSERT_EQ(parked.size(), 1) << "seed " << seed;
    EXPECT_NEAR(parked[0].first, 20.0, 1.0);
    EXPECT_NEAR(parked[0].second, 130.0, 1.0);
    // Too short.
    EXPECT_TRUE(ParkedSeconds(Rest(55.0, seed, still)).empty());
  }
}

TEST(FindParkedIntervals, EndWhereTheMachineMoves) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const auto parked = ParkedSeconds(Rest(150.0, seed, [](double time_s) {
      return time_s > 50.0 && time_s < 54.0 ? 0.1 : 0.0;
    }));
    ASSERT_EQ(parked.size(), 1) << "seed " << seed;
    EXPECT_NEAR(parked[0].first, 74.0, 2.0);
    EXPECT_NEAR(parked[0].second, 130.0, 1.0);
  }
  MotionLogs logs;
  logs.seen_moving_ns = {{40'000'000'000, 100'000'000'000}};
  EXPECT_TRUE(ParkedSeconds(Rest(
                                150.0, 1, [](double) { return 0.0; }, logs))
                  .empty());
}

TEST(FindSeenMotion, IsThatOfImagesInARow) {
  const std::map<image_t, timestamp_t> times_ns = {
      {7, 100}, {3, 200}, {5, 300}, {4, 400}};
  const auto pair = [](image_t first, image_t second, double motion_rad) {
    return VisualRotation{first, second, Eigen::Quaterniond::Identity(), 50,
                          motion_rad};
  };
  using Intervals = std::vector<std::pair<timestamp_t, timestamp_t>>;
  // Ignored: keypoint noise, images not in a row or without a time.
  EXPECT_EQ(FindSeenMotion({pair(7, 3, 0.002), pair(7, 5, 0.1), pair(4, 9, 0.1),
                            pair(5, 4, 0.0)},
                           times_ns),
            Intervals());
  EXPECT_EQ(FindSeenMotion({pair(4, 5, 0.02), pair(7, 3, 0.02)}, times_ns),
            (Intervals{{100, 200}, {300, 400}}));
}

}  // namespace
}  // namespace adasfm
