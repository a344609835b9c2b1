// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensors/smoother/chain_state.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Tangent coordinates of one link: (state k, state k + 1, globals).
inline constexpr int kLinkSize = 2 * ChainState::kSize + ChainGlobals::kSize;

// Speed of a machine at rest, 1 sigma.
inline constexpr double kStandstillSpeedSigma = 0.005;  // m/s

// 1 sigma of the step over a link at rest, m, per axis: such that all links of
// the standstill together reach that speed over its time, or what a machine at
// rest moves in hours (tyres that lose air, people who get in), if that is
// less.
double RestStepSigma(const OdometryLink& link);

// Residuals of one link, each divided by its sigma, and their derivatives by
// the link's tangent coordinates. With A = R_k^T R_k+1, G gravity in the world:
//   IMU       Log(dR^T A), A v_k+1 - v_k - R_k^T G dt - dv,
//             u - v_k dt - R_k^T G dt^2 / 2 - dp      (joint 9x9 covariance)
//   biases    b_k+1 - b_k                             (random walk)
//   wheels    q (u + A l - l) - (M d + N (phi x d)) - D s f   (3x3 / weight),
//             along the direction of driving first
//   yaw       q' z . (Log(A) - D w) - curvature * distance - yaw
//   planar    x . Log(A), y . Log(A)                  (wheels without IMU)
//   vision    Log(V^T A)                              (sigma)
//   at rest   Log(A), u, v_k, v_k+1                   (at a standstill)
// with u the step, l the lever arm and x, y, z the axes of the wheel frame, D
// the wheels' delay, s and w the changes of the wheel frame's speed and of the
// body's rate over the link, f forward in the middle of the rotation; M, N,
// phi, d, q as in WheelMotion. Weak priors are added where no sensor of a link
// observes a coordinate.
struct LinkResiduals {
  Eigen::VectorXd values;
  Eigen::Matrix<double, Eigen::Dynamic, kLinkSize> jacobian;
  // Squared norm of the wheels' residuals, without their weight.
  double wheel_chi2 = 0.0;
  // First row and number of the rows that depend on the accelerometer's noise,
  // the wheels' speed and the wheels' yaw. Each is whitened.
  struct Rows {
    int first = 0;
    int size = 0;
  };
  Rows accelerometer, wheel_speed, wheel_yaw;
};

struct LinkContext {
  const OdometryFusionProblem* problem = nullptr;
  const OdometryFusionOptions* options = nullptr;
};

// wheel_weight: 1, or less where the wheels contradict the other sensors.
LinkResiduals ComputeLinkResiduals(const LinkContext& context,
                                   const OdometryLink& link,
                                   const ChainState& first,
                                   const ChainState& second,
                                   const ChainGlobals& globals,
                                   double wheel_weight);

}  // namespace adasfm
