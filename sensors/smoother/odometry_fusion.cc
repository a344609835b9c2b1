// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/odometry_fusion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sensors/smoother/chain_problem.h"
#include "sensors/smoother/fusion_covariances.h"
#include "sensors/smoother/wheel_slips.h"

namespace adasfm {
namespace {

// Slip thresholds start high and come down, so that links are judged by a
// solution that is nearly right already.
constexpr double kFirstThresholdFactor = 8.0;
// Initial weight of wheels that FindOutlierWheels finds.
constexpr double kFirstSlipWeight = 1e-4;
// Converged: a step of all unknowns together by this share of a sigma.
constexpr double kConvergedStep = 0.01;
// The threshold comes down once no unknown moves by more than this: rad for
// rotations, m/s for velocities, m for positions.
constexpr double kThresholdStep = 1e-2;
// Weights of slipping wheels converge slowly; most drives take 15 iterations.
constexpr int kMaxNumIterations = 100;
// A slipping link is reported when its speed error also exceeds this.
constexpr double kMinSlipSpeed = 0.2;  // m/s

// 1 up to the threshold, then falling faster than the residual grows.
double RobustWeight(double chi2, double threshold_sigma) {
  const double ratio =
      threshold_sigma * threshold_sigma / std::max(chi2, 1e-12);
  return ratio >= 1.0 ? 1.0 : std::max(1e-6, ratio * ratio);
}

class Smoother {
 public:
  Smoother(const OdometryFusionProblem& problem,
           const OdometryFusionOptions& options)
      : problem_(problem), options_(options), chain_(problem, options) {}

  OdometryFusionResult Run();

 private:
  // One damped Gauss-Newton step.
  struct Change {
    double largest = 0.0;  // of a coordinate
    // All coordinates together, in sigmas: sqrt(2 (old - new cost)).
    double num_sigmas = 0.0;
  };
  Change Step();
  // The threshold is kSlipThresholdSigma times factor.
  void UpdateWeights(double factor);
  std::vector<std::pair<size_t, double>> FindSlippingLinks() const;
  void FillResult(OdometryFusionResult* result) const;

  const OdometryFusionProblem& problem_;
  const OdometryFusionOptions& options_;
  ChainProblem chain_;
  double damping_ = 0.0;
};

Smoother::Change Smoother::Step() {
  const double old_cost = chain_.Cost();
  const std::vector<ChainState> old_states = chain_.states;
  const ChainGlobals old_globals = chain_.globals;
  // A failed step is repeated with more damping; eight decades are enough to
  // see that no step lowers the cost.
  for (int attempt = 0; attempt < 8; ++attempt) {
    const ChainSolution solution = SolveChain(
        chain_.NumLinks(), chain_.FirstMessage(),
        [this](size_t k) { return chain_.Equations(k); }, damping_);
    double largest = solution.globals.cwiseAbs().maxCoeff();
    for (size_t k = 0; k < chain_.states.size(); ++k) {
      // No residual depends on the heading: it may drift freely.
      Eigen::Matrix<double, ChainState::kSize, 1> local = solution.states[k];
      local[ChainState::kRotation + 2] = 0.0;
      largest = std::max(largest, local.cwiseAbs().maxCoeff());
      chain_.states[k].Retract(solution.states[k]);
    }
    chain_.globals.values += solution.globals;
    const double cost = chain_.Cost();
    if (std::isfinite(cost) && cost <= old_cost * (1.0 + 1e-9) + 1e-12) {
      damping_ = damping_ < 1e-7 ? 0.0 : 0.1 * damping_;
      return {largest, std::sqrt(2.0 * std::max(0.0, old_cost - cost))};
    }
    chain_.states = old_states;
    chain_.globals = old_globals;
    damping_ = damping_ == 0.0 ? 1e-6 : 10.0 * damping_;
  }
  return Change();
}

void Smoother::UpdateWeights(double factor) {
  const double wheel_threshold = factor * kSlipThresholdSigma;
  for (size_t k = 0; k < chain_.NumLinks(); ++k) {
    const OdometryLink& link = problem_.links[k];
    // Without the IMU the wheels have nothing to contradict.
    if (!link.has_imu || !link.has_wheel) continue;
    chain_.wheel_weights[k] =
        RobustWeight(chain_.Residuals(k).wheel_chi2, wheel_threshold);
  }
}

std::vector<std::pair<size_t, double>> Smoother::FindSlippingLinks() const {
  std::vector<std::pair<size_t, double>> links;
  for (size_t k = 0; k < chain_.NumLinks(); ++k) {
    const OdometryLink& link = problem_.links[k];
    if (!link.has_wheel || chain_.wheel_weights[k] > kSlipWeight) continue;
    const double speed_error = ComputeWheelSpeedError(
        problem_, k, chain_.states[k], chain_.states[k + 1], chain_.globals);
    if (std::abs(speed_error) >= kMinSlipSpeed) {
      links.emplace_back(k, speed_error);
    }
  }
  return links;
}

void Smoother::FillResult(OdometryFusionResult* result) const {
  for (const ChainState& state : chain_.states) {
    result->states.push_back(state.state);
    result->gyroscope_bias += state.state.bias.gyroscope / chain_.states.size();
  }
  result->wheel_scale =
      1.0 / chain_.globals.values[ChainGlobals::kLoggedLength];
  result->wheel_delay_s = chain_.globals.values[ChainGlobals::kWheelDelay];
  result->driving_direction =
      chain_.globals.values.segment<2>(ChainGlobals::kDrivingYaw);
  if (!problem_.links.empty()) FillCovariances(chain_, result);
  result->slipping_links = FindSlippingLinks();
}

OdometryFusionResult Smoother::Run() {
  OdometryFusionResult result;
  double factor = kFirstThresholdFactor;
  for (const size_t k : FindOutlierWheels(problem_, options_.gravity_m_s2)) {
    chain_.wheel_weights[k] = kFirstSlipWeight;
  }
  while (result.num_iterations < kMaxNumIterations) {
    ++result.num_iterations;
    const Change change = Step();
    if (factor == 1.0 && change.num_sigmas < kConvergedStep) {
      result.converged = true;
      break;
    }
    // The threshold comes down once the solution has converged at it.
    if (change.largest < kThresholdStep) factor = std::max(1.0, 0.5 * factor);
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
