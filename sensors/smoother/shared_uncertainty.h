// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "sensors/smoother/chain_elimination.h"
#include "sensors/smoother/odometry_factors.h"

namespace adasfm {

// Estimates how much the variances of the parameters that all links share
// exceed the stated ones: the wheels' scale, the driving direction, the
// gyroscope's bias.
//
// Links are added in sequence: duration (s), whitened residuals and Jacobian at
// the solution, and the marginal covariance of the link's coordinates.
//
// A link's influence on a coordinate x is C_x J^T r, where C_x are the
// covariances of x with the link's coordinates; the sum of the influences is
// the error of x. For independent residuals of unit variance, the squares of
// the sums over blocks of kBlockS add up to the sum of C_x J^T J C_x^T. They
// add up to more if residuals of neighbours are correlated (a machine that
// sways, wheels that err for seconds) or the stated noise is too small: the
// sandwich covariance of clustered residuals. Since few blocks are a poor
// estimate of a variance, 1 has the weight of kPriorBlocks blocks. The number
// of blocks is the effective one.
class SharedUncertainty {
 public:
  enum Index { kScale = 0, kDrivingYaw, kDrivingPitch, kGyro };
  static constexpr int kSize = 6;
  using Vector = Eigen::Array<double, kSize, 1>;

  // The column of a shared coordinate among a link's coordinates.
  static int Column(int index);

  void Add(double dt_s, const LinkResiduals& residuals,
           const LinkCovariance& covariance);
  // Relative growth of the variances, at least 0.
  Vector Growth() const;

 private:
  static constexpr double kBlockS = 2.0;
  static constexpr double kPriorBlocks = 4.0;

  void FinishBlock();

  double block_s_ = 0.0;
  Vector influence_ = Vector::Zero();  // of the present block
  Vector expected_ = Vector::Zero();
  // Over all blocks.
  Vector influence2_ = Vector::Zero();
  Vector expected_sum_ = Vector::Zero();
  Vector expected2_sum_ = Vector::Zero();
  Vector variance_ = Vector::Zero();
};

}  // namespace adasfm
