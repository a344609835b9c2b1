// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/rigid3d.h"
#include "core/so3.h"

namespace adasfm {

// A camera pose while it is adjusted (docs/reference/math.md, Bundle
// adjustment). The solver's parameters are six numbers around the pose at the
// start,
//   R = Exp(w) R_0,  C = C_0 + c,  parameters = (w, c),
// a vector space: no manifold is needed. What every residual of the image needs
// of them is computed once per evaluation by Update().
struct AdjustedPose {
  double parameters[6] = {0, 0, 0, 0, 0, 0};
  Eigen::Quaterniond initial_rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d initial_center = Eigen::Vector3d::Zero();

  // Derived from the parameters.
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  // Jl with Exp(w + d) ~ Exp(Jl d) Exp(w).
  Eigen::Matrix3d left_jacobian = Eigen::Matrix3d::Identity();

  AdjustedPose() = default;
  explicit AdjustedPose(const Rigid3d& cam_from_world)
      : initial_rotation(cam_from_world.rotation),
        initial_center(cam_from_world.TargetOriginInSource()) {
    Update();
  }

  void Update() {
    const Eigen::Map<const Eigen::Vector3d> rotation_vector(parameters);
    rotation = (ExpSo3(rotation_vector) * initial_rotation).toRotationMatrix();
    left_jacobian = RightJacobianSo3(-rotation_vector);
    center = initial_center + Eigen::Map<const Eigen::Vector3d>(parameters + 3);
  }

  Rigid3d CamFromWorld() const {
    const Eigen::Map<const Eigen::Vector3d> rotation_vector(parameters);
    return CamFromWorldWithCenter(ExpSo3(rotation_vector) * initial_rotation,
                                  center);
  }
};

// d (R^T x) / d w.
inline Eigen::Matrix3d RotatedBackJacobian(const AdjustedPose& pose,
                                           const Eigen::Vector3d& x) {
  return pose.rotation.transpose() * Hat(x) * pose.left_jacobian;
}

}  // namespace adasfm
