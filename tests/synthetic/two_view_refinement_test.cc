// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/two_view_refinement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {
namespace {

// A facade on the right and a step of 1 m ahead: with an incomplete derivative
// of the cost, the descent ends far from the minimum.
TEST(RefineTwoViewPose, EndsAtTheLeastCost) {
  constexpr double kLossScalePx = 2.0;
  constexpr double kStep = 1e-3;
  const SyntheticCamera camera;
  const Rigid3d truth(Eigen::Quaterniond::Identity(),
                      -Eigen::Vector3d::UnitZ());
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    std::vector<Bearing> bearings1, bearings2;
    std::vector<FeatureMatch> matches;
    for (point2D_t k = 0; k < 200; ++k) {
      const Eigen::Vector3d point(random.Uniform(4.0, 6.0),
                                  random.Uniform(-5.0, 1.5),
                                  random.Uniform(9.0, 25.0));
      Eigen::Vector2d pixel1, pixel2;
      ProjectPoint(camera, point, &pixel1);
      ProjectPoint(camera, truth * point, &pixel2);
      bearings1.push_back(ComputeBearing(
          camera, pixel1 + random.GaussianVector(0.5).head<2>()));
      bearings2.push_back(ComputeBearing(
          camera, pixel2 + random.GaussianVector(0.5).head<2>()));
      matches.push_back({k, k});
    }
    const auto cost = [&](const Rigid3d& pose) {
      double sum = 0.0;
      for (size_t k = 0; k < matches.size(); ++k) {
        const double error =
            ComputeSampsonErrorPx(bearings1[k], bearings2[k], pose);
        sum += std::log1p(std::pow(error / kLossScalePx, 2));
      }
      return sum;
    };
    const Rigid3d pose =
        RefineTwoViewPose(bearings1, bearings2, matches, truth);
    EXPECT_LT(cost(pose), cost(truth));
    for (int axis = 0; axis < 3; ++axis) {
      for (const double step : {-kStep, kStep}) {
        Rigid3d moved = pose;
        moved.translation += 10.0 * step * Eigen::Vector3d::Unit(axis);
        EXPECT_LE(cost(pose), cost(moved) + 1e-6) << "seed " << seed;
        moved = pose;
        moved.rotation =
            ExpSo3(step * Eigen::Vector3d::Unit(axis)) * moved.rotation;
        EXPECT_LE(cost(pose), cost(moved) + 1e-6) << "seed " << seed;
      }
    }
  }
}

}  // namespace
}  // namespace adasfm
