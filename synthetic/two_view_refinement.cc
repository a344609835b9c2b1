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

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

constexpr int kNumIterations = 6;
constexpr double kLossScalePx = 2.0;
// Keeps the step bounded where the motion is too small to observe a direction.
constexpr double kDamping = 1e-6;
// Step of the numeric derivatives: far above rounding, far below the noise.
constexpr double kDifference = 1e-6;

double SampsonErrorPx(const Bearing& bearing1, const Bearing& bearing2,
                      const Eigen::Matrix3d& rotation,
                      const Eigen::Vector3d& translation) {
  const Eigen::Vector3d normal2 =
      translation.cross(rotation * bearing1.direction);
  const Eigen::Vector3d normal1 =
      rotation.transpose() * bearing2.direction.cross(translation);
  const double gradient =
      std::sqrt((bearing2.jacobian.transpose() * normal2).squaredNorm() +
                (bearing1.jacobian.transpose() * normal1).squaredNorm());
  return normal2.dot(bearing2.direction) / std::max(gradient, 1e-12);
}

// Two unit vectors at a right angle to a unit vector and to each other.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

Rigid3d Move(const Rigid3d& pose, const Vector5d& step) {
  return Rigid3d(
      (ExpSo3(step.head<3>()) * pose.rotation).normalized(),
      (pose.translation + TangentBasis(pose.translation) * step.tail<2>())
          .normalized());
}

// A pose whose errors are evaluated for many matches.
struct Candidate {
  explicit Candidate(const Rigid3d& pose)
      : rotation(pose.rotation.toRotationMatrix()),
        translation(pose.translation) {}
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

}  // namespace

double ComputeSampsonErrorPx(const Bearing& bearing1, const Bearing& bearing2,
                             const Rigid3d& cam2_from_cam1) {
  const Eigen::Vector3d& t = cam2_from_cam1.translation;
  const Eigen::Matrix3d rotation = cam2_from_cam1.rotation.toRotationMatrix();
  // depth1 y + t = depth2 d2, by least squares; the signs are those of the
  // determinants.
  const Eigen::Vector3d y = rotation * bearing1.direction;
  const Eigen::Vector3d& d2 = bearing2.direction;
  const double c = y.dot(d2);
  const double depth1 = c * d2.dot(t) - y.dot(t);
  const double depth2 = d2.dot(t) - c * y.dot(t);
  // Points at infinity scatter about depth zero: allow for the noise.
  const double slack = -1e-5;
  if (depth1 < slack || depth2 < slack) {
    return std::numeric_limits<double>::infinity();
  }
  return std::abs(SampsonErrorPx(bearing1, bearing2, rotation, t));
}

Rigid3d RefineTwoViewPose(const std::vector<Bearing>& bearings1,
                          const std::vector<Bearing>& bearings2,
                          const std::vector<FeatureMatch>& matches,
                          const Rigid3d& initial_cam2_from_cam1) {
  Rigid3d pose = initial_cam2_from_cam1;
  pose.translation.normalize();
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    const Candidate center(pose);
    std::vector<Candidate> moved;
    for (int k = 0; k < 5; ++k) {
      moved.emplace_back(Move(pose, kDifference * Vector5d::Unit(k)));
    }
    Matrix5d hessian = Matrix5d::Zero();
    Vector5d gradient = Vector5d::Zero();
    for (const FeatureMatch& match : matches) {
      const Bearing& bearing1 = bearings1[match.point2D_idx1];
      const Bearing& bearing2 = bearings2[match.point2D_idx2];
      const double error = SampsonErrorPx(bearing1, bearing2, center.rotation,
                                          center.translation);
      Vector5d jacobian;
      for (int k = 0; k < 5; ++k) {
        jacobian(k) = (SampsonErrorPx(bearing1, bearing2, moved[k].rotation,
                                      moved[k].translation) -
                       error) /
                      kDifference;
      }
      const double whitened = error / kLossScalePx;
      const double weight = 1.0 / (1.0 + whitened * whitened);
      hessian += weight * jacobian * jacobian.transpose();
      gradient += weight * error * jacobian;
    }
    hessian.diagonal().array() += kDamping * (1.0 + hessian.trace());
    const Vector5d step = hessian.ldlt().solve(-gradient);
    if (!step.allFinite()) return pose;
    pose = Move(pose, step);
    if (step.norm() < 1e-10) break;
  }
  return pose;
}

}  // namespace adasfm
