// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/compose_inertial_motion.h"

namespace adasfm {

std::optional<InertialMotion> ComposeInertialMotion(
    const OdometryFusionProblem& problem, const OdometryFusionResult& fused,
    size_t first, size_t last, const Rigid3d& cam_from_imu) {
  // In the IMU's axes at the first link.
  InertialMotion motion;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  for (size_t k = first; k < last; ++k) {
    const OdometryLink& link = problem.links[k];
    if (!link.has_imu) return std::nullopt;
    const ImuPreintegration& imu = link.imu;
    ImuBias bias;
    bias.gyroscope = fused.states[k].bias.gyroscope;
    const Eigen::Matrix3d first_from_link = rotation.toRotationMatrix();
    // In this order each update uses the old values of the others.
    motion.delta_position += motion.delta_velocity * imu.dt_s +
                             first_from_link * imu.CorrectedPosition(bias);
    motion.position_by_bias += motion.velocity_by_bias * imu.dt_s +
                               first_from_link * imu.position_by_accelerometer;
    motion.delta_velocity += first_from_link * imu.CorrectedVelocity(bias);
    motion.velocity_by_bias += first_from_link * imu.velocity_by_accelerometer;
    rotation = (rotation * imu.CorrectedRotation(bias)).normalized();
    motion.dt_s += imu.dt_s;
  }
  motion.camera_from_imu_origin = cam_from_imu.Inverse().translation;
  RotateInertialMotion(cam_from_imu.rotation, &motion);
  return motion;
}

}  // namespace adasfm
