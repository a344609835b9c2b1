// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/join_parts.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr int kNumSeeds = 10;
constexpr double kNoiseRad = 0.002;  // a pixel of a phone
constexpr double kStartErrorRad = 0.03;

struct Sights {
  std::vector<SightAcross> sights;
  Sim3d a_from_b;
};

// A camera moves along x; part a ends and part b begins at x = 0. The points of
// both parts are nearby. The first images of b see points of a, the last images
// of a see points of b. step: distance of the images near the end.
Sights BuildSights(double step, double outlier_ratio, uint64_t seed) {
  Random random(seed);
  const auto draw = [&random](double sigma) {
    return random.GaussianVector(sigma);
  };
  Sights world;
  world.a_from_b = Sim3d(std::exp(random.Gaussian(1.0)),
                         Eigen::Quaterniond(ExpSo3(draw(0.5))), draw(5.0));
  const Sim3d b_from_a = world.a_from_b.Inverse();
  for (int p = 0; p < 60; ++p) {
    const bool is_point_of_a = p % 2 == 0;
    const Eigen::Vector3d point = Eigen::Vector3d(0.0, 0.0, 4.0) + draw(1.0);
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d center((is_point_of_a ? step : -step) * k, 0.0,
                                   0.0);
      Eigen::Vector3d ray = (point - center).normalized() + draw(kNoiseRad);
      if (p < outlier_ratio * 60) ray += draw(0.3);
      ray.normalize();
      SightAcross sight;
      sight.point_id = p;
      sight.is_point_of_a = is_point_of_a;
      sight.point = is_point_of_a ? point : b_from_a * point;
      sight.center = is_point_of_a ? b_from_a * center : center;
      sight.ray = is_point_of_a ? b_from_a.rotation * ray : ray;
      sight.max_angle_rad = 8.0 * kNoiseRad;
      world.sights.push_back(sight);
    }
  }
  world.a_from_b.rotation.normalize();
  return world;
}

std::optional<PartJoin> Estimate(const Sights& world) {
  return EstimatePartJoin(
      world.sights,
      Eigen::Quaterniond(ExpSo3(Eigen::Vector3d(kStartErrorRad, 0.0, 0.0))) *
          world.a_from_b.rotation);
}

TEST(EstimatePartJoin, FindsPlaceAndSizeWithinTheirSigma) {
  double chi2 = 0.0;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    for (const double outlier_ratio : {0.0, 0.3}) {
      const Sights world = BuildSights(0.2, outlier_ratio, seed);
      const auto join = Estimate(world);
      ASSERT_TRUE(join) << seed;
      EXPECT_LT(join->log_scale_sigma, 0.05);
      const double error =
          std::log(join->a_from_b.scale / world.a_from_b.scale);
      EXPECT_LT(std::abs(error), 4.0 * join->log_scale_sigma) << seed;
      chi2 += std::pow(error / join->log_scale_sigma, 2) / (2 * kNumSeeds);
      EXPECT_LT(
          join->a_from_b.rotation.angularDistance(world.a_from_b.rotation),
          10.0 * kNoiseRad);
    }
  }
  // The mean of 20 squared normal variables: within five standard errors.
  EXPECT_LT(chi2, 1.0 + 5.0 * std::sqrt(2.0 / (2 * kNumSeeds)));
}

// Images at one place do not constrain the size.
TEST(EstimatePartJoin, KnowsNoSizeOfACameraThatTurnsOnTheSpot) {
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    const auto join = Estimate(BuildSights(0.0, 0.0, seed));
    if (join) {
      EXPECT_GT(join->log_scale_sigma, 0.05) << seed;
    }
  }
}

TEST(EstimatePartJoin, NeedsPoints) {
  Sights world = BuildSights(0.2, 0.0, 1);
  world.sights.resize(4 * 14);
  EXPECT_FALSE(Estimate(world));
  EXPECT_FALSE(EstimatePartJoin({}, Eigen::Quaterniond::Identity()));
}

TEST(EstimatePartJoin, RefusesSightsThatDoNotFit) {
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    EXPECT_FALSE(Estimate(BuildSights(0.2, 1.0, seed))) << seed;
  }
}

}  // namespace
}  // namespace adasfm
