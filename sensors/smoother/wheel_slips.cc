// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/wheel_slips.h"

#include <algorithm>

namespace adasfm {
namespace {

// Wheels that leave this much force unexplained at the start are slipping or
// stuck there: no machine's gravity is off so far.
constexpr double kMaxFirstForceError = 1.5;  // m/s^2

}  // namespace

std::vector<size_t> FindSuspectWheels(const OdometryFusionProblem& problem,
                                      double gravity_m_s2) {
  const size_t num_links = problem.links.size();
  std::vector<size_t> suspects;
  for (size_t k = 0; k < num_links; ++k) {
    const OdometryLink& link = problem.links[k];
    if (!link.has_imu || !link.has_wheel || link.dt_s <= 0.0) continue;
    const OdometryState& first = problem.initial_states[k];
    const OdometryState& second = problem.initial_states[k + 1];
    const Eigen::Vector3d force =
        (link.imu.delta_rotation * second.velocity_in_imu -
         first.velocity_in_imu - link.imu.delta_velocity) /
        link.dt_s;
    const Eigen::Vector3d expected = first.world_from_imu.conjugate() *
                                     Eigen::Vector3d(0.0, 0.0, -gravity_m_s2);
    if ((force - expected).norm() < kMaxFirstForceError) continue;
    for (size_t i = k > 0 ? k - 1 : 0; i < std::min(num_links, k + 2); ++i) {
      if (problem.links[i].has_wheel) suspects.push_back(i);
    }
  }
  std::sort(suspects.begin(), suspects.end());
  suspects.erase(std::unique(suspects.begin(), suspects.end()), suspects.end());
  return suspects;
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
