// SPDX-License-Identifier: BSD-3-Clause
#include "core/so3.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace adasfm {
namespace {

TEST(So3, LogInvertsExpUpToPi) {
  Random random(1);
  for (const double angle : {0.0, 1e-12, 1e-7, 1e-4, 0.1, 1.0, 3.0, 3.14159}) {
    const Eigen::Vector3d vector = angle * random.UnitVector();
    EXPECT_LT((LogSo3(ExpSo3(vector)) - vector).norm(), 1e-12 + 1e-9 * angle);
  }
}

TEST(So3, LogIsTheShortWay) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    Eigen::Quaterniond rotation = ExpSo3(3.0 * random.UnitVector());
    Eigen::Quaterniond negative(-rotation.coeffs());
    EXPECT_LT((LogSo3(rotation) - LogSo3(negative)).norm(), 1e-12);
  }
}

TEST(So3, RightJacobianMatchesNumericDerivative) {
  Random random(3);
  for (const double angle : {1e-6, 1e-3, 0.5, 2.0, 3.0}) {
    const Eigen::Vector3d vector = angle * random.UnitVector();
    Eigen::Matrix3d numeric;
    const double step = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d delta = step * Eigen::Vector3d::Unit(k);
      numeric.col(k) =
          (LogSo3(ExpSo3(vector).conjugate() * ExpSo3(vector + delta)) -
           LogSo3(ExpSo3(vector).conjugate() * ExpSo3(vector - delta))) /
          (2.0 * step);
    }
    EXPECT_LT((numeric - RightJacobianSo3(vector)).norm(), 1e-7);
    EXPECT_LT((RightJacobianSo3(vector) * RightJacobianInverseSo3(vector) -
               Eigen::Matrix3d::Identity())
                  .norm(),
              1e-9);
  }
}

}  // namespace
}  // namespace adasfm
