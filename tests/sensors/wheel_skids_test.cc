// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/wheel_skids.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"

namespace adasfm {
namespace {

// 60 s at 50 Hz and some 8 m/s, with bends of up to 7 m/s^2.
std::vector<WheelSpeed> Drive(uint64_t seed) {
  Random random(seed);
  std::vector<WheelSpeed> speeds;
  for (int i = 0; i < 3000; ++i) {
    const double t_s = 0.02 * i;
    const double speed = 8.0 + std::sin(0.5 * t_s);
    speeds.push_back({NsFromSeconds(t_s), speed + random.Gaussian(0.05),
                      7.0 / 9.0 * std::sin(0.3 * t_s) + random.Gaussian(0.05)});
  }
  return speeds;
}

// Changes the readings from 20 s to 21 s.
template <typename Change>
std::vector<WheelSpeed> Spoilt(std::vector<WheelSpeed> speeds, Change change) {
  for (size_t i = 1000; i < 1050; ++i) change(&speeds[i]);
  return speeds;
}

size_t NumFrom20To21(const std::vector<WheelSpeed>& speeds) {
  size_t count = 0;
  for (const WheelSpeed& speed : speeds) {
    const double t_s = SecondsFromNs(speed.timestamp_ns);
    count += t_s > 19.99 && t_s < 20.99;
  }
  return count;
}

TEST(WheelSkids, AHardDriveStaysWhole) {
  for (const uint64_t seed : {1, 2, 3}) {
    std::vector<WheelSpeed> speeds = Drive(seed);
    EXPECT_EQ(LeaveOutSkids(&speeds), 0);
    EXPECT_EQ(speeds.size(), 3000u);
  }
}

TEST(WheelSkids, OneWheelThatSpins) {
  for (const uint64_t seed : {1, 2, 3}) {
    std::vector<WheelSpeed> speeds =
        Spoilt(Drive(seed), [](WheelSpeed* speed) { speed->yaw_rate += 4.0; });
    EXPECT_EQ(LeaveOutSkids(&speeds), 1);
    EXPECT_EQ(NumFrom20To21(speeds), 0u);
    EXPECT_GT(speeds.size(), 2920u);
  }
}

TEST(WheelSkids, BothWheelsSpinOrLock) {
  for (const double change_m_s : {2.4, -4.0}) {
    std::vector<WheelSpeed> speeds =
        Spoilt(Drive(4),
               [change_m_s](WheelSpeed* speed) { speed->speed += change_m_s; });
    EXPECT_EQ(LeaveOutSkids(&speeds), 1);
    EXPECT_LE(NumFrom20To21(speeds), 1u);
    EXPECT_GT(speeds.size(), 2940u);
  }
}

TEST(WheelSkids, WrongTracksAreNoSkids) {
  std::vector<WheelSpeed> speeds = Drive(5);
  for (WheelSpeed& speed : speeds) speed.yaw_rate *= 4.0;
  EXPECT_EQ(LeaveOutSkids(&speeds), 0);
  EXPECT_EQ(speeds.size(), 3000u);
}

}  // namespace
}  // namespace adasfm
