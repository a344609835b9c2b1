// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace adasfm {

// A rigid transform, named target_from_source:
// x_in_target = rotation * x_in_source + translation.
struct Rigid3d {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d() = default;
  Rigid3d(const Eigen::Quaterniond& rotation,
          const Eigen::Vector3d& translation)
      : rotation(rotation.normalized()), translation(translation) {}
  Rigid3d(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : rotation(Eigen::Quaterniond(rotation).normalized()),
        translation(translation) {}

  // Where the target's origin lies in the source frame: for cam_from_world
  // the camera centre C = -R^T t.
  Eigen::Vector3d TargetOriginInSource() const {
    return rotation.conjugate() * -translation;
  }

  Rigid3d Inverse() const {
    return Rigid3d(rotation.conjugate(), TargetOriginInSource());
  }

  // The 3x4 matrix [R | t].
  Eigen::Matrix<double, 3, 4> ToMatrix() const {
    Eigen::Matrix<double, 3, 4> matrix;
    matrix << rotation.toRotationMatrix(), translation;
    return matrix;
  }
};

inline Eigen::Vector3d operator*(const Rigid3d& target_from_source,
                                 const Eigen::Vector3d& x_in_source) {
  return target_from_source.rotation * x_in_source +
         target_from_source.translation;
}

inline Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return Rigid3d(c_from_b.rotation * b_from_a.rotation,
                 c_from_b * b_from_a.translation);
}

// The relative pose of two cameras, P_12 = P_2 P_1^-1.
inline Rigid3d ComputeCam2FromCam1(const Rigid3d& cam1_from_world,
                                   const Rigid3d& cam2_from_world) {
  return cam2_from_world * cam1_from_world.Inverse();
}

// A pose from its camera centre: cam_from_world with t = -R C.
inline Rigid3d CamFromWorldWithCenter(const Eigen::Quaterniond& cam_from_world,
                                      const Eigen::Vector3d& center_in_world) {
  return Rigid3d(cam_from_world, cam_from_world * -center_in_world);
}

}  // namespace adasfm
