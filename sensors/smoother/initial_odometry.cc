// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/initial_odometry.h"

#include <Eigen/Geometry>
#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

// Time from which the attitude of the first state is found: accelerations
// average out, a gyroscope's drift is still small.
constexpr double kFirstGravityS = 10.0;
// Time constant of the correction towards gravity: long against a bend, short
// against the time in which a gyroscope drifts by a degree.
constexpr double kGravityTimeS = 20.0;
// A link whose unexplained force is further from gravity is not used.
constexpr double kMaxGravityError = 2.0;  // m/s^2

Eigen::Quaterniond LinkRotation(const OdometryLink& link) {
  if (link.has_imu) return link.imu.delta_rotation;
  return link.has_wheel ? link.wheel.profile_rotation
                        : Eigen::Quaterniond::Identity();
}

// The body's mean velocity over a link, in its frame at the start.
Eigen::Vector3d MeanVelocity(const OdometryLink& link,
                             const Rigid3d& imu_from_wheel) {
  if (!link.has_wheel || link.standstill == StandstillKind::kAtRest ||
      link.dt_s <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  const Eigen::Vector3d& lever = imu_from_wheel.translation;
  const Eigen::Vector3d forward =
      imu_from_wheel.rotation * Eigen::Vector3d::UnitX();
  return (link.wheel.displacement_map * forward + lever -
          LinkRotation(link) * lever) /
         link.dt_s;
}

// A state's velocity is the mean of the links on both sides; a link's own mean
// is the velocity at its middle.
std::vector<Eigen::Vector3d> ComputeVelocities(
    const std::vector<OdometryLink>& links, const Rigid3d& imu_from_wheel) {
  std::vector<Eigen::Vector3d> velocities(links.size() + 1,
                                          Eigen::Vector3d::Zero());
  std::vector<double> counts(links.size() + 1, 0.0);
  for (size_t k = 0; k < links.size(); ++k) {
    if (!links[k].has_wheel) continue;
    const Eigen::Quaterniond rotation = LinkRotation(links[k]);
    const Eigen::Vector3d in_first = MeanVelocity(links[k], imu_from_wheel);
    // In the frame at half of the rotation, the mean is the velocity at the
    // middle.
    const Eigen::Quaterniond half =
        Eigen::Quaterniond::Identity().slerp(0.5, rotation);
    const Eigen::Vector3d in_body = half.conjugate() * in_first;
    velocities[k] += in_body;
    velocities[k + 1] += in_body;
    counts[k] += 1.0;
    counts[k + 1] += 1.0;
  }
  for (size_t k = 0; k < velocities.size(); ++k) {
    if (counts[k] > 0.0) velocities[k] /= counts[k];
  }
  return velocities;
}

// Gravity in the body frame at the link's start.
Eigen::Vector3d UnexplainedForce(const OdometryLink& link,
                                 const Eigen::Vector3d& first_velocity,
                                 const Eigen::Vector3d& second_velocity) {
  return (link.imu.delta_rotation * second_velocity - first_velocity -
          link.imu.delta_velocity) /
         link.dt_s;
}

Eigen::Quaterniond FirstAttitude(
    const std::vector<OdometryLink>& links,
    const std::vector<Eigen::Vector3d>& velocities) {
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  Eigen::Quaterniond first_from_body = Eigen::Quaterniond::Identity();
  double time = 0.0;
  for (size_t k = 0; k < links.size() && time < kFirstGravityS; ++k) {
    const OdometryLink& link = links[k];
    if (link.has_imu && link.dt_s > 0.0) {
      gravity +=
          link.dt_s * (first_from_body * UnexplainedForce(link, velocities[k],
                                                          velocities[k + 1]));
    }
    first_from_body = first_from_body * LinkRotation(link);
    time += link.dt_s;
  }
  if (gravity.norm() < 1e-6) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond::FromTwoVectors(gravity, -Eigen::Vector3d::UnitZ());
}

}  // namespace

std::vector<OdometryState> EstimateInitialOdometry(
    const std::vector<OdometryLink>& links, const Rigid3d& imu_from_wheel,
    double gravity_m_s2, const ImuBias& bias) {
  const std::vector<Eigen::Vector3d> velocities =
      ComputeVelocities(links, imu_from_wheel);
  std::vector<OdometryState> states(links.size() + 1);
  states[0].world_from_imu = FirstAttitude(links, velocities);
  for (size_t k = 0; k < states.size(); ++k) {
    states[k].velocity_in_imu = velocities[k];
    states[k].bias = bias;
    if (k == links.size()) break;
    const OdometryLink& link = links[k];
    Eigen::Quaterniond rotation = states[k].world_from_imu;
    if (link.has_imu && link.dt_s > 0.0) {
      const Eigen::Vector3d gravity =
          rotation * UnexplainedForce(link, velocities[k], velocities[k + 1]);
      if (std::abs(gravity.norm() - gravity_m_s2) < kMaxGravityError) {
        const Eigen::Vector3d tilt =
            gravity.normalized().cross(-Eigen::Vector3d::UnitZ());
        const double gain = std::min(1.0, link.dt_s / kGravityTimeS);
        rotation = ExpSo3(gain * tilt) * rotation;
      }
    }
    states[k + 1].world_from_imu = (rotation * LinkRotation(link)).normalized();
  }
  return states;
}

}  // namespace adasfm
