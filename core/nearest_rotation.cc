// SPDX-License-Identifier: BSD-3-Clause
#include "core/nearest_rotation.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace adasfm {

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) {
    sign(2) = -1.0;
  }
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace adasfm
