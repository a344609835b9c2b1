// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/uncertain_motion.h"

#include "core/so3.h"

namespace adasfm {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

Matrix6d ErrorFromTwist(const Eigen::Vector3d& translation) {
  return TwistFromError(-translation);
}

}  // namespace

Matrix6d TwistFromError(const Eigen::Vector3d& translation) {
  Matrix6d matrix = Matrix6d::Identity();
  matrix.bottomLeftCorner<3, 3>() = Hat(translation);
  return matrix;
}

Matrix6d Adjoint(const Rigid3d& target_from_source) {
  const Eigen::Matrix3d rotation =
      target_from_source.rotation.toRotationMatrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  adjoint.bottomLeftCorner<3, 3>() =
      Hat(target_from_source.translation) * rotation;
  return adjoint;
}

UncertainMotion UncertainMotion::Inverse() const {
  UncertainMotion inverse;
  inverse.cam2_from_cam1 = cam2_from_cam1.Inverse();
  const Matrix6d map = ErrorFromTwist(inverse.cam2_from_cam1.translation) *
                       Adjoint(inverse.cam2_from_cam1) *
                       TwistFromError(cam2_from_cam1.translation);
  inverse.covariance = map * covariance * map.transpose();
  return inverse;
}

UncertainMotion operator*(const UncertainMotion& c_from_b,
                          const UncertainMotion& b_from_a) {
  UncertainMotion product;
  product.cam2_from_cam1 = c_from_b.cam2_from_cam1 * b_from_a.cam2_from_cam1;
  const Matrix6d error_from_twist =
      ErrorFromTwist(product.cam2_from_cam1.translation);
  const Matrix6d later =
      error_from_twist * TwistFromError(c_from_b.cam2_from_cam1.translation);
  const Matrix6d earlier = error_from_twist * Adjoint(c_from_b.cam2_from_cam1) *
                           TwistFromError(b_from_a.cam2_from_cam1.translation);
  product.covariance = later * c_from_b.covariance * later.transpose() +
                       earlier * b_from_a.covariance * earlier.transpose();
  return product;
}

Eigen::Matrix3d CovarianceAlong(const Eigen::Vector3d& direction, double along,
                                double across) {
  const Eigen::Matrix3d along_part = direction * direction.transpose();
  return along * along * along_part +
         across * across * (Eigen::Matrix3d::Identity() - along_part);
}

}  // namespace adasfm
