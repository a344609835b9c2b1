// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/chain_problem.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace adasfm {
namespace {

// Wide priors of the first state; its heading is arbitrary.
constexpr double kFirstTiltSigma = 1.0;    // rad
constexpr double kFirstSpeedSigma = 50.0;  // m/s

}  // namespace

ChainProblem::ChainProblem(const OdometryFusionProblem& problem,
                           const OdometryFusionOptions& options)
    : problem(problem),
      options(options),
      wheel_weights(problem.links.size(), 1.0),
      states(problem.initial_states.size()) {
  for (size_t k = 0; k < states.size(); ++k) {
    states[k].state = problem.initial_states[k];
  }
  for (size_t k = 0; k < NumLinks(); ++k) {
    states[k + 1].step_in_previous = InitialStep(k);
  }
}

LinkResiduals ChainProblem::Residuals(size_t k) const {
  return ComputeLinkResiduals({&problem, &options}, problem.links[k], states[k],
                              states[k + 1], globals, wheel_weights[k]);
}

Eigen::Vector3d ChainProblem::InitialStep(size_t k) const {
  const OdometryLink& link = problem.links[k];
  if (!link.has_wheel) return link.dt_s * states[k].state.velocity_in_imu;
  const Eigen::Vector3d& lever = problem.imu_from_wheel.translation;
  const Eigen::Vector3d forward =
      globals.Forward(problem.imu_from_wheel.rotation, nullptr);
  return link.wheel.displacement_map * forward + lever -
         link.wheel.profile_rotation * lever;
}

LinkEquations ChainProblem::Equations(size_t k) const {
  const LinkResiduals residuals = Residuals(k);
  LinkEquations equations;
  equations.h.setZero();
  equations.h.selfadjointView<Eigen::Lower>().rankUpdate(
      residuals.jacobian.transpose());
  equations.h.triangularView<Eigen::StrictlyUpper>() = equations.h.transpose();
  equations.g.noalias() = residuals.jacobian.transpose() * residuals.values;
  return equations;
}

ChainMessage ChainProblem::FirstMessage() const {
  constexpr int kGlobals = ChainState::kSize;
  ChainMessage message;
  Eigen::Matrix<double, ChainMessage::kSize, 1> error, sigma;
  error.setZero();
  sigma.setConstant(1.0);
  const OdometryState& state = states[0].state;
  sigma.segment<3>(ChainState::kRotation).setConstant(kFirstTiltSigma);
  error.segment<3>(ChainState::kVelocity) = state.velocity_in_imu;
  sigma.segment<3>(ChainState::kVelocity).setConstant(kFirstSpeedSigma);
  error.segment<3>(ChainState::kGyro) =
      state.bias.gyroscope - problem.prior_gyroscope_bias;
  sigma.segment<3>(ChainState::kGyro)
      .setConstant(problem.prior_gyroscope_bias_sigma > 0.0
                       ? problem.prior_gyroscope_bias_sigma
                       : options.gyroscope_bias_sigma);
  error.segment<3>(ChainState::kAccel) = state.bias.accelerometer;
  sigma.segment<3>(ChainState::kAccel)
      .setConstant(options.accelerometer_bias_sigma);
  error.tail<ChainGlobals::kSize>() =
      globals.values - ChainGlobals::PriorMeans();
  sigma.segment<ChainGlobals::kSize>(kGlobals) =
      ChainGlobals::PriorSigmas(options);
  const auto information = sigma.cwiseAbs2().cwiseInverse().eval();
  message.h = information.asDiagonal();
  if (problem.wheel_yaw_prior) {
    const WheelYawPrior& prior = *problem.wheel_yaw_prior;
    constexpr int kYaw = kGlobals + ChainGlobals::kLoggedYaw;
    error.segment<2>(kYaw) =
        globals.values.segment<2>(ChainGlobals::kLoggedYaw) -
        Eigen::Vector2d(prior.logged_yaw, prior.curvature);
    message.h.block<2, 2>(kYaw, kYaw) = prior.covariance.inverse();
  }
  message.g = message.h * error;
  return message;
}

double ChainProblem::Cost() const {
  const ChainMessage first = FirstMessage();
  double cost = first.g.dot(first.h.llt().solve(first.g));
  for (size_t k = 0; k < NumLinks(); ++k) {
    cost += Residuals(k).values.squaredNorm();
  }
  return 0.5 * cost;
}

}  // namespace adasfm
