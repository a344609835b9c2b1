// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensors/odometry_fusion.h"

namespace adasfm {

// The unknowns of one time, in the order of their 15 tangent coordinates.
// Everything but the heading is local to the machine, so that a drift of
// kilometres or turns never enters the equations (docs/sensors.md).
struct ChainState {
  enum Offset {
    kRotation = 0,
    kVelocity = 3,
    kGyro = 6,
    kAccel = 9,
    kStep = 12
  };
  static constexpr int kSize = 15;

  OdometryState state;
  // From the previous state's position to this one's, in the previous frame.
  Eigen::Vector3d step_in_previous = Eigen::Vector3d::Zero();

  // R <- Exp_z(d_z) Exp((d_x, d_y, 0)) R; the rest is added.
  void Retract(const Eigen::Matrix<double, kSize, 1>& delta);
};

// The unknowns of all times.
struct ChainGlobals {
  enum Offset {
    kLoggedLength = 0,
    kLoggedYaw,
    kCurvature,
    kMountYaw,
    kMountPitch
  };
  static constexpr int kSize = 5;
  using Vector = Eigen::Matrix<double, kSize, 1>;

  // Logged length = first * true length, logged yaw = second * true yaw -
  // third * distance; the forward direction is turned by the mount angles.
  // Factors stand with what is estimated, not with what was logged: a factor
  // of noisy readings would come out too small, the smaller the noise is then.
  Vector values = (Vector() << 1.0, 1.0, 0.0, 0.0, 0.0).finished();

  static Vector PriorMeans() { return ChainGlobals().values; }
  static Vector PriorSigmas(const OdometryFusionOptions& options);
  // Unit vector in the body frame, and its derivative by (yaw, pitch).
  Eigen::Vector3d Forward(const Eigen::Quaterniond& imu_from_wheel,
                          Eigen::Matrix<double, 3, 2>* jacobian) const;
};

// Tangent coordinates of one link: (state k, state k + 1, globals).
inline constexpr int kLinkSize = 2 * ChainState::kSize + ChainGlobals::kSize;

// Residuals of one link, each divided by its sigma, and their derivatives by
// the link's tangent coordinates. With A = R_k^T R_k+1, G gravity in the world:
//   IMU       Log(dR^T A), A v_k+1 - v_k - R_k^T G dt - dv,
//             u - v_k dt - R_k^T G dt^2 / 2 - dp      (joint 9x9 covariance)
//   biases    b_k+1 - b_k                             (random walk)
//   wheels    q (u + A l - l) - (M d + N (phi x d))   (3x3 / weight)
//   yaw       q' z . Log(A) - curvature * distance - yaw
//   rest      Log(A), u, v_k, v_k+1                   (at a standstill)
// plus weak priors where a link has no sensor for a coordinate.
struct LinkResiduals {
  Eigen::VectorXd values;
  Eigen::Matrix<double, Eigen::Dynamic, kLinkSize> jacobian;
  // Squared norm of the wheels' residuals, before their weight.
  double wheel_chi2 = 0.0;
};

struct LinkContext {
  const OdometryFusionProblem* problem = nullptr;
  const OdometryFusionOptions* options = nullptr;
};

LinkResiduals ComputeLinkResiduals(const LinkContext& context,
                                   const OdometryLink& link,
                                   const ChainState& first,
                                   const ChainState& second,
                                   const ChainGlobals& globals,
                                   double wheel_weight);

}  // namespace adasfm
