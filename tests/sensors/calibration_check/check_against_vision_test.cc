// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/check_against_vision.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// A focal length twice too long halves the rotations that vision measures. In a
// drive of five seconds that ends within its bend, the bend then seems to come
// later; the error must not be reported as a time offset.
TEST(CheckAgainstVision, HalvedTurnsAreNoClockShift) {
  constexpr int kNumImages = 51;
  const auto yaw_rad = [](double time_s) {
    return 0.3 * std::log1p(std::exp(2.0 * (time_s - 3.5)));
  };
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    std::vector<ImuSample> imu;
    for (int i = -10; i <= 510; ++i) {
      ImuSample sample;
      sample.timestamp_ns = 10'000'000LL * i;
      const double time_s = 0.01 * i;
      sample.angular_velocity =
          Eigen::Vector3d(
              0.0, 0.0,
              (yaw_rad(time_s + 1e-3) - yaw_rad(time_s - 1e-3)) / 2e-3) +
          random.GaussianVector(1e-3);
      imu.push_back(sample);
    }
    std::vector<TimedRotation> vision;
    for (int i = 0; i + 2 < kNumImages; ++i) {
      for (int j = i + 1; j <= i + 2; ++j) {
        TimedRotation rotation;
        rotation.start_ns = 100'000'000LL * i;
        rotation.end_ns = 100'000'000LL * j;
        rotation.cam2_from_cam1 =
            ExpSo3(Eigen::Vector3d(
                       0.0, 0.0, -0.5 * (yaw_rad(0.1 * j) - yaw_rad(0.1 * i))) +
                   random.GaussianVector(2e-4));
        vision.push_back(rotation);
      }
    }
    const VisionCheck check =
        CheckAgainstVision(vision, imu, SensorCalibration());
    EXPECT_FALSE(check.contradiction_is_time_shift) << check.contradiction;
    EXPECT_NE(check.contradiction.find("focal length"), std::string::npos)
        << "seed " << seed << ": " << check.contradiction;
  }
}

}  // namespace
}  // namespace adasfm
