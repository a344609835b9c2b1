// SPDX-License-Identifier: BSD-3-Clause
#include "core/sensor_log.h"

#include <gtest/gtest.h>

#include <vector>

namespace adasfm {
namespace {

constexpr timestamp_t kMs = 1'000'000;

// Samples every 10 ms up to 1 s, without those from 0.5 s to before 0.7 s.
std::vector<ImuSample> SamplesWithAGap() {
  std::vector<ImuSample> samples;
  for (timestamp_t time_ms = 0; time_ms <= 1000; time_ms += 10) {
    if (time_ms >= 500 && time_ms < 700) continue;
    samples.emplace_back().timestamp_ns = time_ms * kMs;
  }
  return samples;
}

TEST(CoversInterval, SeesGapsInsideOnly) {
  const std::vector<ImuSample> samples = SamplesWithAGap();
  EXPECT_TRUE(CoversInterval(samples, 0, 490 * kMs, 0.1));
  EXPECT_FALSE(CoversInterval(samples, 0, 500 * kMs, 0.1));
  EXPECT_FALSE(CoversInterval(samples, 550 * kMs, 600 * kMs, 0.1));
  EXPECT_TRUE(CoversInterval(samples, 700 * kMs, 1000 * kMs, 0.1));
  EXPECT_FALSE(CoversInterval(samples, 0, 1000 * kMs + 1, 0.1));
  EXPECT_FALSE(CoversInterval(samples, -1, 490 * kMs, 0.1));
  EXPECT_FALSE(CoversInterval(std::vector<ImuSample>(), 0, 0, 0.1));
}

TEST(SensorLog, FindsTheSamplesAroundATime) {
  const std::vector<ImuSample> samples = SamplesWithAGap();
  EXPECT_EQ(IndexAfter(samples, -1), 0u);
  EXPECT_EQ(IndexAfter(samples, 490 * kMs), 50u);
  EXPECT_EQ(IndexAfter(samples, 1000 * kMs), samples.size());
  EXPECT_EQ(FirstNotBefore(samples, 490 * kMs) - samples.begin(), 49);
  EXPECT_EQ(FirstNotBefore(samples, 500 * kMs) - samples.begin(), 50);
}

}  // namespace
}  // namespace adasfm
