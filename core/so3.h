// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace adasfm {

// The skew-symmetric matrix with Hat(a) * b = a x b.
Eigen::Matrix3d Hat(const Eigen::Vector3d& vector);

// The rotation of a rotation vector (angle times axis, radians).
Eigen::Quaterniond ExpSo3(const Eigen::Vector3d& rotation_vector_rad);

// The rotation vector of a rotation, norm in [0, pi].
Eigen::Vector3d LogSo3(const Eigen::Quaterniond& rotation);

// Jr with Exp(v + d) ~ Exp(v) Exp(Jr d), and its inverse (Forster 2015, eq. 8).
// The left Jacobian is Jl(v) = Jr(-v): Exp(v + d) ~ Exp(Jl d) Exp(v).
Eigen::Matrix3d RightJacobianSo3(const Eigen::Vector3d& rotation_vector_rad);
Eigen::Matrix3d RightJacobianInverseSo3(
    const Eigen::Vector3d& rotation_vector_rad);

// The angle between two rotations, in [0, pi].
double AngleBetweenRad(const Eigen::Quaterniond& a,
                       const Eigen::Quaterniond& b);

// The angle between two vectors, in [0, pi]; zero when either one is zero.
double AngleBetweenRad(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double DegToRad(double angle_deg) {
  return angle_deg * (kPi / 180.0);
}
inline constexpr double RadToDeg(double angle_rad) {
  return angle_rad * (180.0 / kPi);
}

}  // namespace adasfm
