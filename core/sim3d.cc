// SPDX-License-Identifier: BSD-3-Clause
#include "core/sim3d.h"

#include <Eigen/SVD>
#include <stdexcept>

namespace adasfm {

bool EstimateSim3d(const std::vector<Eigen::Vector3d>& source,
                   const std::vector<Eigen::Vector3d>& target,
                   const AlignmentOptions& options, Sim3d* target_from_source) {
  if (source.size() != target.size()) {
    throw std::invalid_argument("EstimateSim3d: point counts differ");
  }
  if (source.size() < 3) return false;
  Eigen::Vector3d source_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_mean = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < source.size(); ++i) {
    source_mean += source[i];
    target_mean += target[i];
  }
  source_mean /= source.size();
  target_mean /= source.size();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double source_variance = 0.0;
  for (size_t i = 0; i < source.size(); ++i) {
    const Eigen::Vector3d centred = source[i] - source_mean;
    covariance += (target[i] - target_mean) * centred.transpose();
    source_variance += centred.squaredNorm();
  }
  if (!(source_variance > 0.0)) return false;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) {
    sign(2) = -1.0;
  }
  const Eigen::Matrix3d rotation =
      svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  const double scale = options.estimate_scale
                           ? svd.singularValues().dot(sign) / source_variance
                           : 1.0;
  if (!(scale > 0.0)) return false;
  *target_from_source = Sim3d(scale, Eigen::Quaterniond(rotation),
                              target_mean - scale * (rotation * source_mean));
  return true;
}

}  // namespace adasfm
