// SPDX-License-Identifier: BSD-3-Clause
#include "core/inertial_motion.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// The motion in world axes must not depend on the axes of the camera.
TEST(RotateInertialMotion, SaysTheSameOfTheWorld) {
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    InertialMotion motion;
    motion.delta_velocity = random.GaussianVector(1.0);
    motion.delta_position = random.GaussianVector(1.0);
    motion.camera_from_imu_origin = random.GaussianVector(1.0);
    motion.by_wheels = MeasuredTranslation{
        random.GaussianVector(1.0),
        random.GaussianVector(1.0).cwiseAbs2().asDiagonal()};
    for (int col = 0; col < 3; ++col) {
      motion.velocity_by_bias.col(col) = random.GaussianVector(1.0);
      motion.position_by_bias.col(col) = random.GaussianVector(1.0);
    }
    const Eigen::Vector3d bias = random.GaussianVector(1.0);
    const Eigen::Quaterniond turn = ExpSo3(random.GaussianVector(1.0));
    InertialMotion turned = motion;
    RotateInertialMotion(turn, &turned);
    const auto expect_same = [&](const Eigen::Vector3d& in_cam,
                                 const Eigen::Vector3d& in_rotated) {
      EXPECT_LT((turn.conjugate() * in_rotated - in_cam).norm(), 1e-12);
    };
    expect_same(
        motion.delta_velocity + motion.velocity_by_bias * bias,
        turned.delta_velocity + turned.velocity_by_bias * (turn * bias));
    expect_same(
        motion.delta_position + motion.position_by_bias * bias,
        turned.delta_position + turned.position_by_bias * (turn * bias));
    expect_same(motion.camera_from_imu_origin, turned.camera_from_imu_origin);
    expect_same(motion.by_wheels->translation, turned.by_wheels->translation);
    const Eigen::Vector3d axis = random.UnitVector();
    EXPECT_NEAR(axis.dot(motion.by_wheels->covariance * axis),
                (turn * axis).dot(turned.by_wheels->covariance * (turn * axis)),
                1e-12);
  }
}

RelativePosePrior MakePrior(image_t image_id1, image_t image_id2,
                            uint32_t flags) {
  RelativePosePrior prior;
  prior.image_id1 = image_id1;
  prior.image_id2 = image_id2;
  prior.flags = flags;
  if (!prior.HasLength()) {
    prior.covariance.diagonal().tail<3>().setConstant(
        std::numeric_limits<double>::infinity());
  }
  return prior;
}

TEST(AddInertialLengths, OnlyToPriorsOfTheSameImagesWithoutLength) {
  // Pair 3-2 is reversed, pair 4-5 has no prior.
  const std::vector<InertialLength> lengths = {{1, 2, 1.5, 0.1, 0.02},
                                               {3, 2, 1.5, 0.1, 0.07},
                                               {3, 4, 1.5, 0.1, 0.08},
                                               {4, 5, 1.5, 0.1, 0.09},
                                               {7, 8, 2.5, 0.2, 0.01}};
  std::vector<RelativePosePrior> priors = {
      MakePrior(1, 2, kPriorRotation), MakePrior(2, 3, kPriorRotation),
      MakePrior(3, 4, kPriorRotation | kPriorDirection | kPriorLength),
      MakePrior(7, 8, kPriorRotation)};
  priors[0].covariance.topLeftCorner<3, 3>() *= 0.25;
  priors[0].covariance.topRightCorner<3, 3>().setConstant(0.1);
  priors[0].covariance.bottomLeftCorner<3, 3>().setConstant(0.1);
  const std::vector<RelativePosePrior> before = priors;
  // The largest unit sigma of the lengths that were added.
  EXPECT_EQ(AddInertialLengths(lengths, &priors), 0.02);

  constexpr uint32_t kFlags =
      kPriorRotation | kPriorLength | kPriorInertialLength;
  EXPECT_EQ(priors[0].flags, kFlags);
  EXPECT_EQ(priors[0].cam2_from_cam1.translation,
            Eigen::Vector3d(0.0, 0.0, 1.5));
  EXPECT_FALSE(priors[0].HasDirection());
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal() << 0.25, 0.25, 0.25, 0.01, 0.01, 0.01;
  EXPECT_LT((priors[0].covariance - covariance).norm(), 1e-15);
  EXPECT_EQ(priors[3].flags, kFlags);
  EXPECT_EQ(priors[3].cam2_from_cam1.translation.norm(), 2.5);
  for (const int i : {1, 2}) {
    EXPECT_EQ(priors[i].flags, before[i].flags);
    EXPECT_EQ(priors[i].covariance, before[i].covariance);
    EXPECT_EQ(priors[i].cam2_from_cam1.translation,
              before[i].cam2_from_cam1.translation);
  }
  EXPECT_EQ(AddInertialLengths({}, &priors), 0.0);
}

TEST(AddInertialLengths, BridgesAreMeasurementsOfTheirMotion) {
  InertialLength length{1, 2, 1.5, 0.1, 0.02};
  length.bridge = MeasuredTranslation{
      {0.5, -1.0, 1.0}, Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal()};
  std::vector<RelativePosePrior> priors = {MakePrior(1, 2, kPriorRotation),
                                           MakePrior(2, 3, kPriorRotation)};
  EXPECT_EQ(AddInertialLengths({length, {2, 3, 2.0, 0.1, 0.01}}, &priors),
            0.02);
  EXPECT_TRUE(priors[0].HasMotion());
  EXPECT_TRUE(priors[0].HasOwnLength());
  EXPECT_EQ(priors[0].cam2_from_cam1.translation, length.bridge->translation);
  EXPECT_EQ(priors[0].covariance(5, 5), 0.03);
  EXPECT_EQ(priors[0].covariance(0, 0), 1.0);
  // Without a bridge the length is vision's, not a measurement of its own.
  EXPECT_TRUE(priors[1].HasLength());
  EXPECT_FALSE(priors[1].HasOwnLength());
}

}  // namespace
}  // namespace adasfm
