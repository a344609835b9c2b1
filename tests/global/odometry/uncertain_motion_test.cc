// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/uncertain_motion.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

UncertainMotion DrawMotion(Random* random) {
  UncertainMotion motion;
  motion.cam2_from_cam1 =
      Rigid3d(ExpSo3(random->GaussianVector(0.7)), random->GaussianVector(3.0));
  Matrix6d root;
  for (int i = 0; i < 36; ++i) root(i) = random->Gaussian(1e-3);
  motion.covariance = root * root.transpose();
  return motion;
}

Rigid3d Disturb(const Rigid3d& motion, const Vector6d& error) {
  return Rigid3d(ExpSo3(error.head<3>()) * motion.rotation,
                 motion.translation + error.tail<3>());
}

Vector6d Difference(const Rigid3d& disturbed, const Rigid3d& motion) {
  Vector6d error;
  error << LogSo3(disturbed.rotation * motion.rotation.conjugate()),
      disturbed.translation - motion.translation;
  return error;
}

constexpr double kStep = 1e-6;

// The covariance of f(motion) by numeric derivatives.
template <typename Function>
Matrix6d Propagate(const UncertainMotion& motion, const Function& f) {
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    jacobian.col(i) =
        Difference(f(Disturb(motion.cam2_from_cam1, kStep * Vector6d::Unit(i))),
                   f(motion.cam2_from_cam1)) /
        kStep;
  }
  return jacobian * motion.covariance * jacobian.transpose();
}

TEST(UncertainMotion, ProductAgreesWithNumericDerivatives) {
  Random random(1);
  for (int k = 0; k < 10; ++k) {
    const UncertainMotion later = DrawMotion(&random);
    const UncertainMotion earlier = DrawMotion(&random);
    const UncertainMotion product = later * earlier;
    EXPECT_TRUE(PosesNear(product.cam2_from_cam1,
                          later.cam2_from_cam1 * earlier.cam2_from_cam1, 1e-12,
                          1e-12));
    const Matrix6d expected =
        Propagate(
            later,
            [&](const Rigid3d& m) { return m * earlier.cam2_from_cam1; }) +
        Propagate(earlier,
                  [&](const Rigid3d& m) { return later.cam2_from_cam1 * m; });
    EXPECT_LT((product.covariance - expected).norm(), 1e-4 * expected.norm());
  }
}

TEST(UncertainMotion, InverseAgreesWithNumericDerivatives) {
  Random random(2);
  for (int k = 0; k < 10; ++k) {
    const UncertainMotion motion = DrawMotion(&random);
    const Matrix6d expected =
        Propagate(motion, [](const Rigid3d& m) { return m.Inverse(); });
    EXPECT_LT((motion.Inverse().covariance - expected).norm(),
              1e-4 * expected.norm());
    EXPECT_LT(
        (motion.Inverse().Inverse().covariance - motion.covariance).norm(),
        1e-9 * motion.covariance.norm());
  }
}

}  // namespace
}  // namespace adasfm
