// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/rigid3d.h"
#include "core/so3.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Parts of the wheels' equation of a link (docs/reference/sensors.md) that the
// smoother's residual and ComposeWheelTranslation have in common.

// Maps the direction of driving to the logged displacement, in the body's axes
// at the start; excess: WheelMotion's phi.
inline Eigen::Matrix3d DisplacementMap(const WheelMotion& wheel,
                                       const Eigen::Vector3d& excess) {
  return wheel.displacement_map + wheel.rotation_moment * Hat(excess);
}

// From the wheel frame in the middle of the link's rotation to the body at its
// start.
inline Eigen::Matrix3d StartFromMiddleWheel(
    const WheelMotion& wheel, const Eigen::Quaterniond& imu_from_wheel) {
  return (Eigen::Quaterniond::Identity().slerp(0.5, wheel.profile_rotation) *
          imu_from_wheel)
      .toRotationMatrix();
}

// Forward speed of the wheel frame's origin at the link's end minus that at its
// start, m/s.
inline double WheelSpeedChange(const OdometryLink& link,
                               const Rigid3d& imu_from_wheel,
                               const OdometryState& first,
                               const OdometryState& second) {
  return (imu_from_wheel.rotation * Eigen::Vector3d::UnitX())
      .dot(second.velocity_in_imu - first.velocity_in_imu +
           link.rate_change.cross(imu_from_wheel.translation));
}

}  // namespace adasfm
