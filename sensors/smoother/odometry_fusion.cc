// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/odometry_fusion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/median.h"
#include "core/so3.h"
#include "sensors/smoother/chain_elimination.h"
#include "sensors/smoother/odometry_factors.h"
#include "sensors/smoother/persistence.h"
#include "sensors/smoother/shared_uncertainty.h"
#include "sensors/smoother/wheel_slips.h"

namespace adasfm {
namespace {

// Priors of the first state: the heading is free to choose, the rest is open.
constexpr double kFirstTiltSigma = 1.0;    // rad
constexpr double kFirstSpeedSigma = 50.0;  // m/s
// Slip thresholds start high and come down, so that links are judged by a
// solution that is nearly right already.
constexpr double kFirstThresholdFactor = 8.0;
// What wheels that are slipping or stuck at the start begin with.
constexpr double kFirstSlipWeight = 1e-4;
// Converged: a step of all unknowns together by this share of a sigma.
constexpr double kConvergedStep = 0.01;
// The threshold comes down after a smaller step than this: rad, m/s, m.
constexpr double kSettledStep = 1e-2;
// Slower machines have no speed that could err by a share, m/s.
constexpr double kMinSpeed = 0.05;

// 1 up to the threshold, then falling faster than the residual grows.
double RobustWeight(double chi2, double threshold_sigma) {
  const double ratio =
      threshold_sigma * threshold_sigma / std::max(chi2, 1e-12);
  return ratio >= 1.0 ? 1.0 : std::max(1e-6, ratio * ratio);
}

// Squares of residuals over their redundancy. Their median is that of the noise
// as long as most links do not slip, also when the stated noise is so small
// that most of them seem to.
struct RowRatios {
  std::vector<double> values;
  double redundancy = 0.0;

  NoiseCheck Check() {
    // The median of a chi-square of one degree of freedom.
    constexpr double kMedian = 0.4549;
    if (values.empty()) return NoiseCheck();
    return {redundancy * UpperMedian(&values) / kMedian, redundancy};
  }
};

struct NoiseChecks {
  RowRatios wheel_speed, wheel_yaw;
  NoiseCheck accelerometer;
  Persistence wheel_persistence;
  std::vector<double> speed_sigma_ratios;
};

class Smoother {
 public:
  Smoother(const OdometryFusionProblem& problem,
           const OdometryFusionOptions& options)
      : problem_(problem), options_(options), weights_(problem.links.size()) {
    context_ = {&problem_, &options_};
    states_.resize(problem.initial_states.size());
    for (size_t k = 0; k < states_.size(); ++k) {
      states_[k].state = problem.initial_states[k];
    }
    for (size_t k = 0; k < problem.links.size(); ++k) {
      states_[k + 1].step_in_previous = InitialStep(k);
    }
  }

  OdometryFusionResult Run();

 private:
  Eigen::Vector3d InitialStep(size_t k) const;
  LinkResiduals Residuals(size_t k) const {
    return ComputeLinkResiduals(context_, problem_.links[k], states_[k],
                                states_[k + 1], globals_, weights_[k]);
  }
  LinkEquations Equations(size_t k) const;
  ChainMessage FirstMessage() const;
  double Cost() const;
  // One damped Gauss-Newton step.
  struct Change {
    double largest = 0.0;  // of a coordinate
    // By how many sigmas all coordinates together: sqrt(2 (old - new cost)).
    double num_sigmas = 0.0;
  };
  Change Step();
  // Thresholds are the options' times factor.
  void UpdateWeights(double factor);
  // The motion over a link, without its covariance, and its derivative by the
  // link's coordinates.
  OdometryMotion Motion(size_t k) const;
  Eigen::Matrix<double, 6, kLinkSize> MotionMap(size_t k) const;
  // 1 sigma of the speed at the link's end as a ratio, the scale known.
  double SpeedSigmaRatio(size_t k, const LinkCovariance& covariance) const;
  void CheckNoise(size_t k, const LinkResiduals& residuals,
                  const LinkCovariance& covariance, NoiseChecks* checks) const;
  void FillCovariances(OdometryFusionResult* result) const;
  std::vector<std::pair<size_t, double>> FindSlippingLinks() const;
  void FillResult(OdometryFusionResult* result) const;

  const OdometryFusionProblem& problem_;
  const OdometryFusionOptions& options_;
  LinkContext context_;
  std::vector<LinkWeights> weights_;
  std::vector<ChainState> states_;
  ChainGlobals globals_;
  double damping_ = 0.0;
};

Eigen::Vector3d Smoother::InitialStep(size_t k) const {
  const OdometryLink& link = problem_.links[k];
  if (!link.has_wheel) return link.dt_s * states_[k].state.velocity_in_imu;
  const Eigen::Vector3d& lever = problem_.imu_from_wheel.translation;
  const Eigen::Vector3d forward =
      globals_.Forward(problem_.imu_from_wheel.rotation, nullptr);
  return link.wheel.displacement_map * forward + lever -
         link.wheel.profile_rotation * lever;
}

LinkEquations Smoother::Equations(size_t k) const {
  const LinkResiduals residuals = Residuals(k);
  LinkEquations equations;
  equations.h.setZero();
  equations.h.selfadjointView<Eigen::Lower>().rankUpdate(
      residuals.jacobian.transpose());
  equations.h.triangularView<Eigen::StrictlyUpper>() = equations.h.transpose();
  equations.g.noalias() = residuals.jacobian.transpose() * residuals.values;
  return equations;
}

ChainMessage Smoother::FirstMessage() const {
  constexpr int kGlobals = ChainState::kSize;
  ChainMessage message;
  Eigen::Matrix<double, ChainMessage::kSize, 1> error, sigma;
  error.setZero();
  sigma.setConstant(1.0);
  const OdometryState& state = states_[0].state;
  sigma.segment<3>(ChainState::kRotation).setConstant(kFirstTiltSigma);
  error.segment<3>(ChainState::kVelocity) = state.velocity_in_imu;
  sigma.segment<3>(ChainState::kVelocity).setConstant(kFirstSpeedSigma);
  error.segment<3>(ChainState::kGyro) =
      state.bias.gyroscope - problem_.prior_gyroscope_bias;
  sigma.segment<3>(ChainState::kGyro)
      .setConstant(problem_.prior_gyroscope_bias_sigma > 0.0
                       ? problem_.prior_gyroscope_bias_sigma
                       : options_.gyroscope_bias_sigma);
  error.segment<3>(ChainState::kAccel) = state.bias.accelerometer;
  sigma.segment<3>(ChainState::kAccel)
      .setConstant(options_.accelerometer_bias_sigma);
  error.tail<ChainGlobals::kSize>() =
      globals_.values - ChainGlobals::PriorMeans();
  sigma.segment<ChainGlobals::kSize>(kGlobals) =
      ChainGlobals::PriorSigmas(options_);
  const auto information = sigma.cwiseAbs2().cwiseInverse().eval();
  message.h = information.asDiagonal();
  message.g = information.cwiseProduct(error);
  return message;
}

double Smoother::Cost() const {
  const ChainMessage first = FirstMessage();
  double cost = first.g.cwiseAbs2().cwiseQuotient(first.h.diagonal()).sum();
  for (size_t k = 0; k < problem_.links.size(); ++k) {
    cost += Residuals(k).values.squaredNorm();
  }
  return 0.5 * cost;
}

Smoother::Change Smoother::Step() {
  const double old_cost = Cost();
  const std::vector<ChainState> old_states = states_;
  const ChainGlobals old_globals = globals_;
  // A failed step is repeated with more damping; eight decades are enough to
  // tell that there is nothing to gain.
  for (int attempt = 0; attempt < 8; ++attempt) {
    const ChainSolution solution = SolveChain(
        problem_.links.size(), FirstMessage(),
        [this](size_t k) { return Equations(k); }, damping_);
    double largest = solution.globals.cwiseAbs().maxCoeff();
    for (size_t k = 0; k < states_.size(); ++k) {
      // The heading has no bearing on anything: it may drift freely.
      Eigen::Matrix<double, ChainState::kSize, 1> local = solution.states[k];
      local[ChainState::kRotation + 2] = 0.0;
      largest = std::max(largest, local.cwiseAbs().maxCoeff());
      states_[k].Retract(solution.states[k]);
    }
    globals_.values += solution.globals;
    const double cost = Cost();
    if (std::isfinite(cost) && cost <= old_cost * (1.0 + 1e-9) + 1e-12) {
      damping_ = damping_ < 1e-7 ? 0.0 : 0.1 * damping_;
      return {largest, std::sqrt(2.0 * std::max(0.0, old_cost - cost))};
    }
    states_ = old_states;
    globals_ = old_globals;
    damping_ = damping_ == 0.0 ? 1e-6 : 10.0 * damping_;
  }
  return Change();
}

void Smoother::UpdateWeights(double factor) {
  const double wheel_threshold = factor * options_.slip_threshold_sigma;
  const double vision_threshold = factor * options_.vision_threshold_sigma;
  for (size_t k = 0; k < problem_.links.size(); ++k) {
    const OdometryLink& link = problem_.links[k];
    // Without the IMU there is nothing that they could contradict.
    if (!link.has_imu || !(link.has_wheel || link.has_vision)) continue;
    const LinkResiduals residuals = Residuals(k);
    if (link.has_wheel) {
      weights_[k].wheel = RobustWeight(residuals.wheel_chi2, wheel_threshold);
    }
    if (link.has_vision) {
      weights_[k].vision =
          RobustWeight(residuals.vision_chi2, vision_threshold);
    }
  }
}

OdometryMotion Smoother::Motion(size_t k) const {
  OdometryMotion motion;
  const Eigen::Quaterniond r21 =
      states_[k + 1].state.world_from_imu.conjugate() *
      states_[k].state.world_from_imu;
  motion.body2_from_body1 =
      Rigid3d(r21, r21 * -states_[k + 1].step_in_previous);
  motion.wheel_weight = weights_[k].wheel;
  return motion;
}

Eigen::Matrix<double, 6, kLinkSize> Smoother::MotionMap(size_t k) const {
  const Eigen::Matrix3d r2_transposed =
      states_[k + 1].state.world_from_imu.toRotationMatrix().transpose();
  const Eigen::Quaterniond r21 =
      states_[k + 1].state.world_from_imu.conjugate() *
      states_[k].state.world_from_imu;
  // dtheta = R2^T (d1 - d2), dt = [R21 u]x dtheta - R21 du.
  Eigen::Matrix<double, 6, kLinkSize> map;
  map.setZero();
  map.block<3, 3>(0, ChainState::kRotation) = r2_transposed;
  map.block<3, 3>(0, ChainState::kSize + ChainState::kRotation) =
      -r2_transposed;
  map.bottomRows<3>() =
      Hat(r21 * states_[k + 1].step_in_previous) * map.topRows<3>();
  map.block<3, 3>(3, ChainState::kSize + ChainState::kStep) -=
      r21.toRotationMatrix();
  return map;
}

std::vector<std::pair<size_t, double>> Smoother::FindSlippingLinks() const {
  std::vector<std::pair<size_t, double>> links;
  for (size_t k = 0; k < problem_.links.size(); ++k) {
    const OdometryLink& link = problem_.links[k];
    if (!link.has_wheel || weights_[k].wheel > kSlipWeight) continue;
    const double speed_error = ComputeWheelSpeedError(problem_, k, states_[k],
                                                      states_[k + 1], globals_);
    if (std::abs(speed_error) >= options_.slip_min_speed_m_s) {
      links.emplace_back(k, speed_error);
    }
  }
  return links;
}

double Smoother::SpeedSigmaRatio(size_t k,
                                 const LinkCovariance& covariance) const {
  constexpr int kVelocity = ChainState::kSize + ChainState::kVelocity;
  const int scale = SharedUncertainty::Column(SharedUncertainty::kScale);
  const Eigen::Vector3d& velocity = states_[k + 1].state.velocity_in_imu;
  const double speed = std::max(velocity.norm(), kMinSpeed);
  const Eigen::Vector3d by_scale = covariance.block<3, 1>(kVelocity, scale);
  const Eigen::Matrix3d known =
      covariance.block<3, 3>(kVelocity, kVelocity) -
      by_scale * by_scale.transpose() / covariance(scale, scale);
  return std::sqrt(std::max(0.0, velocity.dot(known * velocity))) /
         (speed * speed);
}

void Smoother::CheckNoise(size_t k, const LinkResiduals& residuals,
                          const LinkCovariance& covariance,
                          NoiseChecks* checks) const {
  const OdometryLink& link = problem_.links[k];
  // Wheels at rest err less.
  if (!link.has_imu || !link.has_wheel ||
      link.standstill != StandstillKind::kNone) {
    checks->wheel_persistence.FinishBlock();
    return;
  }
  const auto redundancy = [&](int row) {
    const auto jacobian = residuals.jacobian.row(row);
    return 1.0 - (jacobian * covariance).cwiseProduct(jacobian).sum();
  };
  const auto add = [&](const LinkResiduals::Rows& rows, double factor,
                       RowRatios* ratios) {
    for (int row = rows.first; row < rows.first + rows.size; ++row) {
      const double share = redundancy(row);
      if (share <= 0.0) continue;
      const double value = residuals.values[row];
      ratios->values.push_back(factor * value * value /
                               (weights_[k].wheel * share));
      ratios->redundancy += share;
    }
  };
  add(residuals.wheel_speed, problem_.wheel_persistence, &checks->wheel_speed);
  add(residuals.wheel_yaw, 1.0, &checks->wheel_yaw);
  checks->speed_sigma_ratios.push_back(SpeedSigmaRatio(k, covariance));
  if (weights_[k].wheel < 1.0) {
    checks->wheel_persistence.FinishBlock();
    return;
  }
  checks->wheel_persistence.Add(link.dt_s,
                                residuals.values[residuals.wheel_speed.first]);
  const LinkResiduals::Rows& rows = residuals.accelerometer;
  for (int row = rows.first; row < rows.first + rows.size; ++row) {
    checks->accelerometer.chi2 += residuals.values[row] * residuals.values[row];
    checks->accelerometer.redundancy += redundancy(row);
  }
}

void Smoother::FillCovariances(OdometryFusionResult* result) const {
  using Shared = SharedUncertainty;
  constexpr int kMount = 2 * ChainState::kSize + ChainGlobals::kMountYaw;
  constexpr int kDelay = 2 * ChainState::kSize + ChainGlobals::kWheelDelay;
  const size_t num_links = problem_.links.size();
  result->motions.resize(num_links);
  Shared shared;
  NoiseChecks checks;
  // How a motion moves with one sigma of each shared coordinate.
  std::vector<Eigen::Matrix<double, 6, Shared::kSize>> by_shared(num_links);
  double accel_variance = 0.0, length_variance = 0.0, delay_variance = 0.0;
  Eigen::Array2d mount_variance(0.0, 0.0);
  ComputeChainCovariances(
      num_links, FirstMessage(), [this](size_t k) { return Equations(k); },
      [&](size_t k, const LinkCovariance& covariance) {
        const LinkResiduals residuals = Residuals(k);
        CheckNoise(k, residuals, covariance, &checks);
        shared.Add(problem_.links[k].dt_s, residuals, covariance);
        const Eigen::Matrix<double, 6, kLinkSize> map = MotionMap(k);
        result->motions[k] = Motion(k);
        result->motions[k].covariance = map * covariance * map.transpose();
        for (int i = 0; i < Shared::kSize; ++i) {
          const int column = Shared::Column(i);
          by_shared[k].col(i) = map * covariance.col(column) /
                                std::sqrt(covariance(column, column));
        }
        result->gyroscope_bias_covariance +=
            covariance.block<3, 3>(ChainState::kGyro, ChainState::kGyro) /
            num_links;
        accel_variance +=
            covariance.diagonal().segment<3>(ChainState::kAccel).mean();
        length_variance = covariance(Shared::Column(Shared::kScale),
                                     Shared::Column(Shared::kScale));
        mount_variance = covariance.diagonal().segment<2>(kMount);
        delay_variance = covariance(kDelay, kDelay);
      });
  result->accelerometer_check = checks.accelerometer;
  result->wheel_speed_check = checks.wheel_speed.Check();
  result->wheel_yaw_check = checks.wheel_yaw.Check();
  // The less the smoother follows the wheels, the more of it residuals show.
  result->wheel_persistence =
      problem_.wheel_persistence * checks.wheel_persistence.Ratio();
  result->speed_sigma_ratio = UpperMedian(&checks.speed_sigma_ratios);
  const Shared::Vector growth = shared.Growth();
  for (size_t k = 0; k < num_links; ++k) {
    result->motions[k].covariance +=
        by_shared[k] * growth.matrix().asDiagonal() * by_shared[k].transpose();
  }
  const Eigen::Vector3d root =
      (1.0 + growth.segment<3>(Shared::kGyro)).sqrt().matrix();
  result->gyroscope_bias_covariance =
      (root.asDiagonal() * result->gyroscope_bias_covariance *
       root.asDiagonal())
          .eval();
  result->gyroscope_bias_sigma =
      std::sqrt(result->gyroscope_bias_covariance.trace() / 3.0);
  result->wheel_delay_sigma_s = std::sqrt(delay_variance);
  result->accelerometer_bias_sigma = std::sqrt(accel_variance / num_links);
  const double length = globals_.values[ChainGlobals::kLoggedLength];
  result->wheel_scale_sigma =
      std::sqrt(length_variance * (1.0 + growth[Shared::kScale])) /
      (length * length);
  result->wheel_mount_sigma =
      (mount_variance * (1.0 + growth.segment<2>(Shared::kMountYaw)))
          .sqrt()
          .matrix();
}

void Smoother::FillResult(OdometryFusionResult* result) const {
  for (const ChainState& state : states_) {
    result->states.push_back(state.state);
    result->gyroscope_bias += state.state.bias.gyroscope / states_.size();
  }
  result->wheel_scale = 1.0 / globals_.values[ChainGlobals::kLoggedLength];
  result->wheel_delay_s = globals_.values[ChainGlobals::kWheelDelay];
  result->wheel_mount = globals_.values.segment<2>(ChainGlobals::kMountYaw);
  if (!problem_.links.empty()) FillCovariances(result);
  result->slipping_links = FindSlippingLinks();
}

OdometryFusionResult Smoother::Run() {
  OdometryFusionResult result;
  double factor = kFirstThresholdFactor;
  for (const size_t k : FindSuspectWheels(problem_, options_.gravity_m_s2)) {
    weights_[k].wheel = kFirstSlipWeight;
  }
  while (result.num_iterations < options_.max_num_iterations) {
    ++result.num_iterations;
    const Change change = Step();
    if (factor == 1.0 && change.num_sigmas < kConvergedStep) {
      result.converged = true;
      break;
    }
    // The threshold comes down once the solution has settled at it.
    if (change.largest < kSettledStep) factor = std::max(1.0, 0.5 * factor);
    UpdateWeights(factor);
  }
  FillResult(&result);
  return result;
}

}  // namespace

double NoiseCheck::Factor() const {
  return std::sqrt((kPriorRedundancy + chi2) / (kPriorRedundancy + redundancy));
}

OdometryFusionResult FuseOdometry(const OdometryFusionProblem& problem,
                                  const OdometryFusionOptions& options) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  if (problem.initial_states.size() != problem.links.size() + 1) {
    throw std::invalid_argument(
        "FuseOdometry: one initial state more than links is needed");
  }
  return Smoother(problem, options).Run();
}

}  // namespace adasfm
