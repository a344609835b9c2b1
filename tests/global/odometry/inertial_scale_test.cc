// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/inertial_scale.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/global/inertial_walk.h"

namespace adasfm {
namespace {

std::optional<InertialScale> Estimate(const WalkData& data) {
  return EstimateInertialScale(data.motions, data.cams_from_world);
}

// At most one of twenty walks has an error above three of its own sigmas.
void ExpectHonest(const WalkOptions& options, double max_sigma) {
  int num_outside = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const auto scale = Estimate(SimulateWalk(options, seed));
    ASSERT_TRUE(scale.has_value()) << "seed " << seed;
    EXPECT_LE(scale->sigma_ratio, max_sigma) << "seed " << seed;
    const double error = scale->metres_per_unit / options.metres_per_unit - 1.0;
    num_outside += std::abs(error) > 3.0 * scale->sigma_ratio;
  }
  EXPECT_LE(num_outside, 1);
}

TEST(EstimateInertialScale, FindsTheSizeOfACleanWalk) { ExpectHonest({}, 0.1); }

TEST(EstimateInertialScale, IsHonestAboutNoisyCentresAndRotations) {
  WalkOptions options;
  options.center_noise_m = 0.003;
  options.tilt_noise_rad = 0.003;
  ExpectHonest(options, 0.1);
}

TEST(EstimateInertialScale, DoesNotDependOnTheUnit) {
  WalkOptions options;
  options.center_noise_m = 0.002;
  options.metres_per_unit = 1.0;
  const auto metres = Estimate(SimulateWalk(options, 1));
  options.metres_per_unit = 1e4;
  const auto other = Estimate(SimulateWalk(options, 1));
  ASSERT_TRUE(metres && other);
  EXPECT_NEAR(other->metres_per_unit / metres->metres_per_unit, 1e4, 1e-2);
}

TEST(EstimateInertialScale, KnowsNothingOfAMachineAtRest) {
  WalkOptions options;
  options.is_at_rest = true;
  options.center_noise_m = 0.003;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_FALSE(Estimate(SimulateWalk(options, seed))) << "seed " << seed;
  }
}

TEST(EstimateInertialScale, NeedsAccelerationsThatAreGravity) {
  WalkData data = SimulateWalk({}, 1);
  for (InertialMotion& motion : data.motions) {  // in g, not m/s^2
    motion.delta_velocity /= 9.81;
    motion.delta_position /= 9.81;
  }
  EXPECT_FALSE(Estimate(data));
}

TEST(EstimateInertialScale, SpansNoHoles) {
  // Every fourth image is missing: no run has enough of them.
  WalkData data = SimulateWalk({}, 1);
  for (image_t image_id = 4; image_id <= 200; image_id += 4) {
    data.cams_from_world.erase(image_id);
  }
  EXPECT_FALSE(Estimate(data));
}

}  // namespace
}  // namespace adasfm
