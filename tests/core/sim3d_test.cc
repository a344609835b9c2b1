// SPDX-License-Identifier: BSD-3-Clause
#include "core/sim3d.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

Sim3d RandomSim3d(Random* random) {
  return Sim3d(random->Uniform(0.1, 10.0), ExpSo3(random->GaussianVector(1.0)),
               random->GaussianVector(5.0));
}

TEST(Sim3d, InverseUndoes) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Sim3d b_from_a = RandomSim3d(&random);
    const Eigen::Vector3d x = random.GaussianVector(3.0);
    EXPECT_LT((b_from_a.Inverse() * (b_from_a * x) - x).norm(), 1e-10);
    EXPECT_LT(((b_from_a.Inverse() * b_from_a) * x - x).norm(), 1e-10);
  }
}

TEST(Sim3d, TransformedCameraSeesTransformedPointsInTheSameDirection) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const Sim3d new_from_old = RandomSim3d(&random);
    const Rigid3d cam_from_old(ExpSo3(random.GaussianVector(1.0)),
                               random.GaussianVector(2.0));
    const Rigid3d cam_from_new =
        TransformCamFromWorld(new_from_old, cam_from_old);
    const Eigen::Vector3d x = random.GaussianVector(3.0);
    EXPECT_LT((cam_from_new * (new_from_old * x) -
               new_from_old.scale * (cam_from_old * x))
                  .norm(),
              1e-9);
  }
}

TEST(EstimateSim3d, RecoversTheTruthWithoutNoise) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    const Sim3d truth = RandomSim3d(&random);
    std::vector<Eigen::Vector3d> source;
    std::vector<Eigen::Vector3d> target;
    for (int i = 0; i < 3 + static_cast<int>(seed); ++i) {
      source.push_back(random.GaussianVector(4.0));
      target.push_back(truth * source.back());
    }
    Sim3d estimate;
    ASSERT_TRUE(EstimateSim3d(source, target, {}, &estimate));
    EXPECT_NEAR(estimate.scale, truth.scale, 1e-9 * truth.scale);
    EXPECT_TRUE(RotationsNear(estimate.rotation, truth.rotation, 1e-8));
  }
}

TEST(EstimateSim3d, KeepsTheScaleAtOneWhenRigid) {
  Random random(3);
  const Sim3d truth(2.0, ExpSo3(random.GaussianVector(1.0)),
                    random.GaussianVector(1.0));
  std::vector<Eigen::Vector3d> source;
  std::vector<Eigen::Vector3d> target;
  for (int i = 0; i < 10; ++i) {
    source.push_back(random.GaussianVector(4.0));
    target.push_back(truth * source.back());
  }
  AlignmentOptions options;
  options.estimate_scale = false;
  Sim3d estimate;
  ASSERT_TRUE(EstimateSim3d(source, target, options, &estimate));
  EXPECT_EQ(estimate.scale, 1.0);
  EXPECT_TRUE(RotationsNear(estimate.rotation, truth.rotation, 1e-8));
}

TEST(EstimateSim3d, RefusesWhatSaysNothing) {
  Sim3d estimate;
  const std::vector<Eigen::Vector3d> two(2, Eigen::Vector3d::Ones());
  EXPECT_FALSE(EstimateSim3d(two, two, {}, &estimate));
  const std::vector<Eigen::Vector3d> same(5, Eigen::Vector3d::Ones());
  EXPECT_FALSE(EstimateSim3d(same, same, {}, &estimate));
  EXPECT_THROW(EstimateSim3d(two, same, {}, &estimate), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
