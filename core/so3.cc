// SPDX-License-Identifier: BSD-3-Clause
#include "core/so3.h"

#include <algorithm>
#include <cmath>

namespace adasfm {
namespace {

// Below this angle a series is used; its error is below 1e-13.
constexpr double kSmallAngleRad = 1e-4;

}  // namespace

Eigen::Matrix3d Hat(const Eigen::Vector3d& vector) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -vector.z(), vector.y(), vector.z(), 0.0, -vector.x(),
      -vector.y(), vector.x(), 0.0;
  return matrix;
}

Eigen::Quaterniond ExpSo3(const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  const double half = 0.5 * angle;
  // sin(angle / 2) / angle.
  const double factor = angle < kSmallAngleRad ? 0.5 - angle * angle / 48.0
                                               : std::sin(half) / angle;
  const Eigen::Vector3d imaginary = factor * rotation_vector_rad;
  return Eigen::Quaterniond(std::cos(half), imaginary.x(), imaginary.y(),
                            imaginary.z())
      .normalized();
}

Eigen::Vector3d LogSo3(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d imaginary = sign * rotation.vec();
  const double w = sign * rotation.w();
  const double sine = imaginary.norm();
  if (sine < 0.5 * kSmallAngleRad) {
    return 2.0 * imaginary / w * (1.0 - sine * sine / (3.0 * w * w));
  }
  return 2.0 * std::atan2(sine, w) / sine * imaginary;
}

Eigen::Matrix3d RightJacobianSo3(const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  const Eigen::Matrix3d hat = Hat(rotation_vector_rad);
  if (angle < kSmallAngleRad) {
    return Eigen::Matrix3d::Identity() - 0.5 * hat + hat * hat / 6.0;
  }
  const double angle2 = angle * angle;
  return Eigen::Matrix3d::Identity() - (1.0 - std::cos(angle)) / angle2 * hat +
         (angle - std::sin(angle)) / (angle2 * angle) * hat * hat;
}

Eigen::Matrix3d RightJacobianInverseSo3(
    const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  const Eigen::Matrix3d hat = Hat(rotation_vector_rad);
  if (angle < kSmallAngleRad) {
    return Eigen::Matrix3d::Identity() + 0.5 * hat + hat * hat / 12.0;
  }
  const double half = 0.5 * angle;
  const double factor = (1.0 - half / std::tan(half)) / (angle * angle);
  return Eigen::Matrix3d::Identity() + 0.5 * hat + factor * hat * hat;
}

double AngleBetweenRad(const Eigen::Quaterniond& a,
                       const Eigen::Quaterniond& b) {
  return LogSo3(a.conjugate() * b).norm();
}

double AngleBetweenRad(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace adasfm
