// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/two_view_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/so3.h"

namespace adasfm {
namespace {

constexpr int kNumIterations = 6;
constexpr double kLossScalePx = 2.0;
// Keeps the step bounded where the motion is too small to show a direction.
constexpr double kDamping = 1e-6;

struct EpipolarError {
  double error_px;
  double px_per_unit;
  Eigen::Vector3d ray1_in_cam2;
};

EpipolarError ComputeError(const Bearing& bearing1, const Bearing& bearing2,
                           const Eigen::Matrix3d& rotation,
                           const Eigen::Vector3d& translation) {
  const Eigen::Vector3d y = rotation * bearing1.direction;
  const Eigen::Vector3d normal2 = translation.cross(y);
  const Eigen::Vector3d normal1 =
      rotation.transpose() * bearing2.direction.cross(translation);
  const double gradient =
      std::sqrt((bearing2.jacobian.transpose() * normal2).squaredNorm() +
                (bearing1.jacobian.transpose() * normal1).squaredNorm());
  const double px_per_unit = 1.0 / std::max(gradient, 1e-12);
  return {px_per_unit * normal2.dot(bearing2.direction), px_per_unit, y};
}

// Two unit vectors at a right angle to a unit vector and to each other.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

}  // namespace

double ComputeSampsonErrorPx(const Bearing& bearing1, const Bearing& bearing2,
                             const Rigid3d& cam2_from_cam1) {
  const Eigen::Vector3d& t = cam2_from_cam1.translation;
  const EpipolarError error = ComputeError(
      bearing1, bearing2, cam2_from_cam1.rotation.toRotationMatrix(), t);
  // depth1 y + t = depth2 d2, by least squares; the signs are those of the
  // determinants.
  const Eigen::Vector3d& y = error.ray1_in_cam2;
  const Eigen::Vector3d& d2 = bearing2.direction;
  const double c = y.dot(d2);
  const double depth1 = c * d2.dot(t) - y.dot(t);
  const double depth2 = d2.dot(t) - c * y.dot(t);
  // Points at infinity scatter about depth zero: allow for the noise.
  const double slack = -1e-5;
  if (depth1 < slack || depth2 < slack) {
    return std::numeric_limits<double>::infinity();
  }
  return std::abs(error.error_px);
}

Rigid3d RefineTwoViewPose(const std::vector<Bearing>& bearings1,
                          const std::vector<Bearing>& bearings2,
                          const std::vector<FeatureMatch>& matches,
                          const Rigid3d& initial_cam2_from_cam1) {
  Rigid3d pose = initial_cam2_from_cam1;
  pose.translation.normalize();
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    const Eigen::Vector3d t = pose.translation;
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(t);
    Matrix5d hessian = Matrix5d::Zero();
    Vector5d gradient = Vector5d::Zero();
    for (const FeatureMatch& match : matches) {
      const Bearing& bearing2 = bearings2[match.point2D_idx2];
      const EpipolarError error =
          ComputeError(bearings1[match.point2D_idx1], bearing2, rotation, t);
      const Eigen::Vector3d& y = error.ray1_in_cam2;
      const Eigen::Vector3d& d2 = bearing2.direction;
      Vector5d jacobian;
      jacobian.head<3>() = y.cross(d2.cross(t));
      jacobian.tail<2>() = basis.transpose() * y.cross(d2);
      jacobian *= error.px_per_unit;
      const double whitened = error.error_px / kLossScalePx;
      const double weight = 1.0 / (1.0 + whitened * whitened);
      hessian += weight * jacobian * jacobian.transpose();
      gradient += weight * error.error_px * jacobian;
    }
    hessian.diagonal().array() += kDamping * (1.0 + hessian.trace());
    const Vector5d step = hessian.ldlt().solve(-gradient);
    if (!step.allFinite()) return pose;
    pose.rotation = (ExpSo3(step.head<3>()) * pose.rotation).normalized();
    pose.translation = (t + basis * step.tail<2>()).normalized();
    if (step.norm() < 1e-10) break;
  }
  return pose;
}

}  // namespace adasfm
