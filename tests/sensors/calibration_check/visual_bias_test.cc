// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/visual_bias.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

const Eigen::Vector3d kBias(0.004, -0.003, 0.001);
const Eigen::Vector3d kOffset(-0.003, 0.002, 0.0);

// A walk with a phone, 50 s at 6 photos a second. Vision errs by 0.2 deg an
// axis, by the offset, and for 3 s by moving objects.
RotationComparison Walk(int max_gap, uint64_t seed) {
  constexpr double kFrameS = 1.0 / 6.0;
  Random random(seed);
  RotationComparison data;
  for (int frame = 0; frame < 300; ++frame) {
    for (int gap = 1; gap <= max_gap; ++gap) {
      const double start_s = frame * kFrameS;
      const double dt_s = gap * kFrameS;
      const Eigen::Vector3d turn = random.GaussianVector(0.4 * dt_s);
      Eigen::Vector3d visual =
          turn + dt_s * kBias + kOffset + random.GaussianVector(DegToRad(0.2));
      if (start_s > 30.0 && start_s < 33.0) {
        visual.x() -= dt_s * random.Uniform(0.1, 0.6);
      }
      data.visual.push_back(visual);
      data.gyro.push_back(turn);
      data.start_s.push_back(start_s);
      data.dt_s.push_back(dt_s);
    }
  }
  return data;
}

TEST(VisualBias, TellsARateFromWhatAllPairsErrBy) {
  double square = 0.0, square_of_medians = 0.0, sigma = 0.0;
  constexpr int kNumSeeds = 20;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const RotationComparison data = Walk(6, seed);
    const Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
    const VisualBias bias = EstimateVisualBias(data, map);
    square += (bias.rate - kBias).squaredNorm() / (3 * kNumSeeds);
    square_of_medians +=
        (ComputeRotationFit(data, map).rate_offset - kBias).squaredNorm() /
        (3 * kNumSeeds);
    sigma += bias.sigma / kNumSeeds;
  }
  EXPECT_LT(std::sqrt(square), 1.0e-3);
  EXPECT_LT(std::sqrt(square), 0.25 * std::sqrt(square_of_medians));
  // 60 values determine a variance to 18 %. The moving objects make the sigma
  // conservative.
  EXPECT_GT(sigma, 0.7 * std::sqrt(square));
  EXPECT_LT(sigma, 2.0 * std::sqrt(square));
}

// Intervals of one length do not separate the two; the sigma covers that.
TEST(VisualBias, OneLengthOfIntervalsLeavesTheOffsetIn) {
  for (const uint64_t seed : {1, 2, 3}) {
    const VisualBias bias =
        EstimateVisualBias(Walk(1, seed), Eigen::Matrix3d::Identity());
    EXPECT_GT((bias.rate - kBias).norm(), 0.01);
    EXPECT_LT((bias.rate - kBias).norm(), 2.0 * bias.sigma);
  }
}

TEST(VisualBias, TooLittleSaysNothing) {
  EXPECT_TRUE(
      std::isinf(EstimateVisualBias({}, Eigen::Matrix3d::Identity()).sigma));
  RotationComparison data = Walk(3, 1);
  data.visual.resize(5);
  data.gyro.resize(5);
  data.start_s.resize(5);
  data.dt_s.resize(5);
  EXPECT_TRUE(
      std::isinf(EstimateVisualBias(data, Eigen::Matrix3d::Identity()).sigma));
}

}  // namespace
}  // namespace adasfm
