// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "sensors/smoother/chain_elimination.h"
#include "sensors/smoother/odometry_factors.h"

namespace adasfm {

// How much larger than stated the variance is of what all links share: the
// wheels' scale, their mounting, and the gyroscope's bias.
//
// Inputs: of each link in order its duration (s), whitened residuals and
// Jacobian at the solution, and the marginal covariance of its coordinates.
//
// Method. A link's influence on a coordinate x is C_x J^T r, C_x the
// covariances of x with the link's coordinates; the influences' sum is the
// error of x. If residuals are independent, of unit variance, the squares of
// the sums over blocks of kBlockS add up to the sum of C_x J^T J C_x^T. If
// neighbours are alike (a machine that sways, wheels that err for seconds) or
// the stated noise is too small, to more: the sandwich covariance of clustered
// residuals. As few blocks tell a variance badly, 1 weighs as much as
// kPriorBlocks of them; the blocks are counted by their share.
class SharedUncertainty {
 public:
  enum Index { kScale = 0, kMountYaw, kMountPitch, kGyro };
  static constexpr int kSize = 6;
  using Vector = Eigen::Array<double, kSize, 1>;

  // The columns of a link's coordinates.
  static int Column(int index);

  void Add(double dt_s, const LinkResiduals& residuals,
           const LinkCovariance& covariance);
  // By how much the variance grows, as a share of the variance: at least 0.
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
