// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/noise_checks.h"

#include <algorithm>
#include <cmath>

#include "core/median.h"
#include "sensors/smoother/shared_uncertainty.h"

namespace adasfm {
namespace {

// Least speed in the ratio, m/s: slower machines have no relative error.
constexpr double kMinSpeed = 0.05;

// 1 sigma of the speed at a link's end as a ratio, given the wheels' scale.
double SpeedSigmaRatio(const OdometryState& end,
                       const LinkCovariance& covariance) {
  constexpr int kVelocity = ChainState::kSize + ChainState::kVelocity;
  const int scale = SharedUncertainty::Column(SharedUncertainty::kScale);
  const Eigen::Vector3d& velocity = end.velocity_in_imu;
  const double speed = std::max(velocity.norm(), kMinSpeed);
  const Eigen::Vector3d by_scale = covariance.block<3, 1>(kVelocity, scale);
  const Eigen::Matrix3d known =
      covariance.block<3, 3>(kVelocity, kVelocity) -
      by_scale * by_scale.transpose() / covariance(scale, scale);
  return std::sqrt(std::max(0.0, velocity.dot(known * velocity))) /
         (speed * speed);
}

}  // namespace

NoiseCheck NoiseChecks::RowRatios::Check() {
  // The median of a chi-square of one degree of freedom.
  constexpr double kMedian = 0.4549;
  if (values.empty()) return NoiseCheck();
  return {redundancy * UpperMedian(&values) / kMedian, redundancy};
}

void NoiseChecks::Add(const ChainProblem& chain, size_t k,
                      const LinkResiduals& residuals,
                      const LinkCovariance& covariance) {
  const OdometryLink& link = chain.problem.links[k];
  const double wheel_weight = chain.wheel_weights[k];
  // Wheels at rest err less.
  if (!link.has_imu || !link.has_wheel ||
      link.standstill != StandstillKind::kNone) {
    wheel_persistence_.FinishBlock();
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
      ratios->values.push_back(factor * value * value / (wheel_weight * share));
      ratios->redundancy += share;
    }
  };
  add(residuals.wheel_speed, chain.problem.wheel_persistence, &wheel_speed_);
  add(residuals.wheel_yaw, 1.0, &wheel_yaw_);
  speed_sigma_ratios_.push_back(
      SpeedSigmaRatio(chain.states[k + 1].state, covariance));
  if (wheel_weight < 1.0) {
    wheel_persistence_.FinishBlock();
    return;
  }
  wheel_persistence_.Add(link.dt_s,
                         residuals.values[residuals.wheel_speed.first]);
  const LinkResiduals::Rows& rows = residuals.accelerometer;
  for (int row = rows.first; row < rows.first + rows.size; ++row) {
    accelerometer_.chi2 += residuals.values[row] * residuals.values[row];
    accelerometer_.redundancy += redundancy(row);
  }
}

void NoiseChecks::Fill(double problem_persistence,
                       OdometryFusionResult* result) {
  result->accelerometer_check = accelerometer_;
  result->wheel_speed_check = wheel_speed_.Check();
  result->wheel_yaw_check = wheel_yaw_.Check();
  // Residuals show more of the persistence the less the smoother follows the
  // wheels.
  result->wheel_persistence = problem_persistence * wheel_persistence_.Ratio();
  result->speed_sigma_ratio = UpperMedian(&speed_sigma_ratios_);
}

}  // namespace adasfm
