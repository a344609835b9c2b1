// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/sensor_log.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// What the IMU felt at the time of an image, without its biases, in its axes.
struct ImuMotion {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();            // rad/s
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();  // m/s^2
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();        // m/s
};

// None where the log does not cover the time (IMU's clock). state: at the time.
std::optional<ImuMotion> MeasureImuMotion(const std::vector<ImuSample>& log,
                                          timestamp_t timestamp_ns,
                                          const OdometryState& state);

// Set the derivatives of a motion between two images by timeshift_cam_imu, from
// what the IMU felt at both (docs/reference/math.md, Shared errors of the
// odometry). The motion must be complete otherwise.
void SetTimeShiftEffects(const ImuMotion& first, const ImuMotion& second,
                         const Rigid3d& cam_from_imu, RelativePosePrior* prior);
void SetTimeShiftEffects(const ImuMotion& first, const ImuMotion& second,
                         const Rigid3d& cam_from_imu,
                         const RelativePosePrior& prior,
                         InertialMotion* motion);

}  // namespace adasfm
