// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/clock_jump.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

// The error message of a drive whose IMU clock jumps in its middle.
std::string ErrorOf(uint64_t seed, double jump_s, double shift_s) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 160));
  Dataset data = ToDataset(world);
  const size_t middle = data.logs.imu.size() / 2;
  for (size_t i = 0; i < data.logs.imu.size(); ++i) {
    const double late_s = shift_s + (i >= middle ? jump_s : 0.0);
    data.logs.imu[i].timestamp_ns += std::llround(1e9 * late_s);
  }
  data.logs.wheel.clear();
  const StatusOr<PriorEstimate> estimate =
      EstimatePriors(data.images, data.logs, data.calibration,
                     SimulateVision(world, seed), {});
  return estimate.ok() ? "" : estimate.status().message();
}

TEST(ClockJump, IsNamed) {
  for (const uint64_t seed : {1, 2, 3}) {
    for (const double jump_s : {0.1, 0.5}) {
      const std::string error = ErrorOf(seed, jump_s, 0.0);
      EXPECT_NE(error.find("the IMU's clock jumps"), std::string::npos)
          << seed << ", " << jump_s << ": " << error;
    }
  }
}

TEST(ClockJump, IsNotMistakenForAShift) {
  for (const uint64_t seed : {1, 2, 3}) {
    EXPECT_NE(ErrorOf(seed, 0.0, 0.2).find("images and IMU differ by"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace adasfm
