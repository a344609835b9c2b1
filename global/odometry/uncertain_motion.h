// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "core/rigid3d.h"

namespace adasfm {

// A relative pose with the covariance of its error (dtheta, dt) in the frame of
// camera 2, as RelativePosePrior states it: R_true = Exp(dtheta) R,
// t_true = t + dt. Units rad^2, rad m, m^2.
struct UncertainMotion {
  Rigid3d cam2_from_cam1;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();

  UncertainMotion Inverse() const;
};

// c_from_b * b_from_a, with independent errors, to first order.
UncertainMotion operator*(const UncertainMotion& c_from_b,
                          const UncertainMotion& b_from_a);

// The error (dtheta, dt) of a motion with this translation is the twist
// xi = (dtheta, dt - dtheta x t) of P_true = exp(xi) P.
Eigen::Matrix<double, 6, 6> TwistFromError(const Eigen::Vector3d& translation);

// Covariance of a translation by its sigmas along a unit vector and across it.
Eigen::Matrix3d CovarianceAlong(const Eigen::Vector3d& direction, double along,
                                double across);

// The same twist seen from another frame: (R omega, R v + t x R omega).
Eigen::Matrix<double, 6, 6> Adjoint(const Rigid3d& target_from_source);

}  // namespace adasfm
