// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>

#include "core/so3.h"
#include "sensors/smoother/odometry_factors.h"

namespace adasfm {

// Collects the whitened rows of one link for ComputeLinkResiduals.
class LinkBuilder {
 public:
  // First columns of the link's tangent coordinates.
  static constexpr int kFirst = 0;
  static constexpr int kSecond = ChainState::kSize;
  static constexpr int kGlobals = 2 * ChainState::kSize;

  LinkBuilder(const LinkContext& context, const OdometryLink& link,
              const ChainState& first, const ChainState& second,
              const ChainGlobals& globals)
      : context_(context),
        link_(link),
        first_(first),
        second_(second),
        globals_(globals),
        r1_transposed_(
            first.state.world_from_imu.toRotationMatrix().transpose()),
        r2_(second.state.world_from_imu.toRotationMatrix()),
        a_rotation_(first.state.world_from_imu.conjugate() *
                    second.state.world_from_imu),
        a_(a_rotation_.toRotationMatrix()) {
    values_.setZero();
    jacobian_.setZero();
  }

  void AddImu();
  void AddBiasWalk();
  // The weight divides the covariance and must be positive.
  void AddWheel(double weight);
  void AddVision();
  void AddStandstill();
  void AddWeakPriors();

  LinkResiduals Finish() const {
    LinkResiduals result = rows_;
    result.values = values_.head(num_rows_);
    result.jacobian = jacobian_.topRows(num_rows_);
    result.wheel_chi2 = wheel_chi2_;
    return result;
  }

 private:
  // No link has more residuals: IMU 9, biases 6, wheels 3, rotation 3,
  // standstill 12, planar 2, vision 3, weak priors 9.
  static constexpr int kMaxResiduals = 48;

  // Adds the derivative of a row block v(A) by both rotations, from its
  // derivative by x, where dA = A Exp(x), x = R2^T (d2 - d1).
  template <int N>
  void AddRelativeRotation(int row,
                           const Eigen::Matrix<double, N, 3>& by_rotation) {
    const Eigen::Matrix<double, N, 3> by_world = by_rotation * r2_.transpose();
    jacobian_.block<N, 3>(row, kSecond + ChainState::kRotation) += by_world;
    jacobian_.block<N, 3>(row, kFirst + ChainState::kRotation) -= by_world;
  }

  // A vector residual of the relative rotation alone.
  void AddRotationResidual(const Eigen::Quaterniond& measured,
                           const Eigen::Matrix3d& covariance) {
    const Eigen::Vector3d error = LogSo3(measured.conjugate() * a_rotation_);
    values_.segment<3>(num_rows_) = error;
    AddRelativeRotation<3>(num_rows_, RightJacobianInverseSo3(error));
    Whiten<3>(covariance);
  }

  // A scalar prior on one coordinate.
  void AddScalar(int column, double error, double sigma) {
    values_[num_rows_] = error / sigma;
    jacobian_(num_rows_, column) = 1.0 / sigma;
    ++num_rows_;
  }

  void AddVector(int column, const Eigen::Vector3d& error, double sigma) {
    for (int i = 0; i < 3; ++i) AddScalar(column + i, error[i], sigma);
  }

  // Multiplies the next N rows by the inverse root of their covariance and
  // counts them.
  template <int N>
  void Whiten(const Eigen::Matrix<double, N, N>& covariance) {
    const Eigen::LLT<Eigen::Matrix<double, N, N>> llt(covariance);
    auto values = values_.segment<N>(num_rows_);
    auto jacobian = jacobian_.middleRows<N>(num_rows_);
    llt.matrixL().solveInPlace(values);
    llt.matrixL().solveInPlace(jacobian);
    num_rows_ += N;
  }

  // No step, and no velocity at either end.
  void AddRest();
  void AddWheelDelay(int forward_row);
  void AddWheelYaw(double weight);
  void AddPlanarRotation();

  const LinkContext& context_;
  const OdometryLink& link_;
  const ChainState& first_;
  const ChainState& second_;
  const ChainGlobals& globals_;
  const Eigen::Matrix3d r1_transposed_;
  const Eigen::Matrix3d r2_;
  const Eigen::Quaterniond a_rotation_;
  const Eigen::Matrix3d a_;
  int num_rows_ = 0;
  LinkResiduals rows_;  // only the row ranges
  double wheel_chi2_ = 0.0;
  Eigen::Matrix<double, kMaxResiduals, 1> values_;
  Eigen::Matrix<double, kMaxResiduals, kLinkSize> jacobian_;
};

}  // namespace adasfm
