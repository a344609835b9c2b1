// SPDX-License-Identifier: BSD-3-Clause
#include "core/nearest_rotation.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Also for matrices with a negative determinant.
TEST(NearestRotation, IsARotationAndNoneIsNearer) {
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    Random random(seed);
    Eigen::Matrix3d matrix;
    for (int k = 0; k < 3; ++k) matrix.col(k) = random.GaussianVector(1.0);
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Matrix3d rotation = NearestRotation(sign * matrix);
      EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity())
                    .norm(),
                1e-12);
      EXPECT_NEAR(rotation.determinant(), 1.0, 1e-12);
      const double distance = (rotation - sign * matrix).norm();
      for (int k = 0; k < 200; ++k) {
        const Eigen::Matrix3d other =
            ExpSo3(random.GaussianVector(k % 2 == 0 ? 0.01 : 1.0))
                .toRotationMatrix() *
            rotation;
        EXPECT_GE((other - sign * matrix).norm(), distance - 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace adasfm
