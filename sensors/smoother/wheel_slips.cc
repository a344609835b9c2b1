// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/wheel_slips.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/median.h"

namespace adasfm {
namespace {

// Wheels that leave this much force unexplained in the initial states slip or
// are stuck: no machine's initial gravity is so far off.
constexpr double kMaxFirstForceError = 1.5;  // m/s^2
// Sum of jumps that smaller forces may cause in the links without a jump.
constexpr double kMaxFirstSpeedError = 1.0;  // m/s

// Increase of the wheels' speed over link k minus that of the accelerometer's,
// along the forward direction, m/s; none where the unexplained force is
// gravity.
std::optional<double> FindJump(const OdometryFusionProblem& problem, size_t k,
                               double gravity_m_s2) {
  const OdometryLink& link = problem.links[k];
  if (!link.has_imu || !link.has_wheel || link.dt_s <= 0.0) return std::nullopt;
  const OdometryState& first = problem.initial_states[k];
  const OdometryState& second = problem.initial_states[k + 1];
  const Eigen::Vector3d force =
      (link.imu.delta_rotation * second.velocity_in_imu -
       first.velocity_in_imu - link.imu.delta_velocity) /
      link.dt_s;
  const Eigen::Vector3d error =
      force - first.world_from_imu.conjugate() *
                  Eigen::Vector3d(0.0, 0.0, -gravity_m_s2);
  if (error.norm() < kMaxFirstForceError) return std::nullopt;
  const Eigen::Vector3d forward =
      problem.imu_from_wheel.rotation * Eigen::Vector3d::UnitX();
  return link.dt_s * forward.dot(error);
}

}  // namespace

std::vector<size_t> FindOutlierWheels(const OdometryFusionProblem& problem,
                                      double gravity_m_s2) {
  const size_t num_links = problem.links.size();
  std::vector<bool> is_outlier(num_links, false);
  std::vector<double> offsets(num_links, 0.0);
  double offset = 0.0;
  for (size_t k = 0; k < num_links; ++k) {
    const OdometryLink& link = problem.links[k];
    const std::optional<double> jump = FindJump(problem, k, gravity_m_s2);
    if (jump) {
      offset += *jump;
      for (size_t i = k > 0 ? k - 1 : 0; i < std::min(num_links, k + 2); ++i) {
        is_outlier[i] = true;
      }
    }
    // At rest wheels are right, and across a hole the offset is unknown: it
    // restarts.
    if (!link.has_imu || !link.has_wheel ||
        link.standstill == StandstillKind::kAtRest) {
      offset = 0.0;
    }
    offsets[k] = offset;
  }
  std::vector<double> sorted = offsets;
  const double usual_offset = UpperMedian(&sorted);
  std::vector<size_t> outliers;
  for (size_t k = 0; k < num_links; ++k) {
    if (problem.links[k].has_wheel &&
        (is_outlier[k] ||
         std::abs(offsets[k] - usual_offset) > kMaxFirstSpeedError)) {
      outliers.push_back(k);
    }
  }
  return outliers;
}

double ComputeWheelSpeedError(const OdometryFusionProblem& problem, size_t k,
                              const ChainState& first, const ChainState& second,
                              const ChainGlobals& globals) {
  const OdometryLink& link = problem.links[k];
  if (link.dt_s <= 0.0) return 0.0;
  const double scale = 1.0 / globals.values[ChainGlobals::kLoggedLength];
  const Eigen::Vector3d& lever = problem.imu_from_wheel.translation;
  const Eigen::Vector3d forward =
      globals.Forward(problem.imu_from_wheel.rotation, nullptr);
  const Eigen::Quaterniond rotation =
      first.state.world_from_imu.conjugate() * second.state.world_from_imu;
  const Eigen::Vector3d moved =
      second.step_in_previous + rotation * lever - lever;
  const Eigen::Vector3d logged =
      scale * (link.wheel.displacement_map * forward);
  const double direction = link.wheel.distance_m < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d along =
      direction * (logged.norm() > 1e-6 ? logged.normalized() : forward);
  return (logged - moved).dot(along) / link.dt_s;
}

}  // namespace adasfm
