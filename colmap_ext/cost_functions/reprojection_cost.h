// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>
#include <ceres/rotation.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <algorithm>

#include "colmap_ext/cost_functions/adjusted_pose.h"

namespace adasfm {

// A keypoint with its camera's intrinsics folded in: an error e on the
// normalised image plane is whitened_from_normalized * e sigmas in the image
// (exact for pinhole cameras, first order in e for the others).
struct NormalizedKeypoint {
  Eigen::Vector2d normalized = Eigen::Vector2d::Zero();
  Eigen::Matrix2d whitened_from_normalized = Eigen::Matrix2d::Identity();
};

// Points nearer to the camera's plane than this do not project.
inline constexpr double kMinProjectionDepth = 1e-6;
// Residual per coordinate, in sigmas, of an observation whose point does not
// project: a constant, so that it counts in the cost but has no gradient.
inline constexpr double kBehindCameraResidual = 1e3;

// One observation of a point, r = W (pi(R (X - C)) - x), x and W of the
// keypoint, in sigmas. The pose is read from the object, which must be up to
// date.
struct PointObservation {
  NormalizedKeypoint keypoint;
  const AdjustedPose* pose = nullptr;

  // The residual and, unless null, its derivatives by the parameters of the
  // pose (2 x 6) and by X (2 x 3), row by row.
  void Evaluate(const Eigen::Vector3d& point, double* residuals,
                double* by_pose, double* by_point) const {
    const Eigen::Vector3d x_in_cam = pose->rotation * (point - pose->center);
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    if (!(x_in_cam.z() > kMinProjectionDepth)) {
      residual.setConstant(kBehindCameraResidual);
      if (by_pose != nullptr) std::fill_n(by_pose, 12, 0.0);
      if (by_point != nullptr) std::fill_n(by_point, 6, 0.0);
      return;
    }
    const double inverse_depth = 1.0 / x_in_cam.z();
    const Eigen::Vector2d projected = x_in_cam.head<2>() * inverse_depth;
    const Eigen::Matrix2d& whitened = keypoint.whitened_from_normalized;
    residual = whitened * (projected - keypoint.normalized);
    if (by_pose == nullptr && by_point == nullptr) return;

    Eigen::Matrix<double, 2, 3> residual_from_cam;
    residual_from_cam.leftCols<2>() = whitened * inverse_depth;
    residual_from_cam.col(2) = whitened * projected * -inverse_depth;
    const Eigen::Matrix<double, 2, 3> residual_from_world =
        residual_from_cam * pose->rotation;
    if (by_pose != nullptr) {
      // dx = -Hat(x) Jl dw - R dc; a row n of -Hat(x) is (x cross n)^T.
      Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> jacobian(
          by_pose);
      Eigen::Matrix<double, 2, 3> from_rotation;
      from_rotation.row(0) =
          x_in_cam.cross(residual_from_cam.row(0).transpose());
      from_rotation.row(1) =
          x_in_cam.cross(residual_from_cam.row(1).transpose());
      jacobian.leftCols<3>().noalias() = from_rotation * pose->left_jacobian;
      jacobian.rightCols<3>() = -residual_from_world;
    }
    if (by_point != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> jacobian(
          by_point);
      jacobian = residual_from_world;
    }
  }
};

// The same for Ceres. Parameters: AdjustedPose::parameters (6), X in the world
// (3).
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  ReprojectionCost(const NormalizedKeypoint& keypoint, const AdjustedPose* pose)
      : observation_{keypoint, pose} {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final {
    const bool has_jacobians = jacobians != nullptr;
    observation_.Evaluate(Eigen::Map<const Eigen::Vector3d>(parameters[1]),
                          residuals, has_jacobians ? jacobians[0] : nullptr,
                          has_jacobians ? jacobians[1] : nullptr);
    return true;
  }

 private:
  PointObservation observation_;
};

// The same with the camera's intrinsics as third parameter, for automatic
// differentiation: r = (project(R (X - C)) - keypoint) / sigma.
template <typename CameraModel>
class CameraReprojectionCost {
 public:
  CameraReprojectionCost(const Eigen::Vector2d& keypoint, double sigma_px,
                         const AdjustedPose* pose)
      : keypoint_(keypoint), sigma_px_(sigma_px), pose_(pose) {}

  template <typename T>
  bool operator()(const T* pose_parameters, const T* point,
                  const T* camera_params, T* residuals) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> x(point);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> c(pose_parameters + 3);
    const Eigen::Matrix<T, 3, 1> turned =
        pose_->initial_rotation.toRotationMatrix().cast<T>() *
        (x - c - pose_->initial_center.cast<T>());
    T x_in_cam[3];
    ceres::AngleAxisRotatePoint(pose_parameters, turned.data(), x_in_cam);
    if (!(x_in_cam[2] > T(kMinProjectionDepth))) {
      residuals[0] = residuals[1] = T(kBehindCameraResidual);
      return true;
    }
    if (!CameraModel::Project(camera_params, T(x_in_cam[0] / x_in_cam[2]),
                              T(x_in_cam[1] / x_in_cam[2]), residuals)) {
      residuals[0] = residuals[1] = T(kBehindCameraResidual);
      return true;
    }
    residuals[0] = (residuals[0] - keypoint_.x()) / sigma_px_;
    residuals[1] = (residuals[1] - keypoint_.y()) / sigma_px_;
    return true;
  }

 private:
  const Eigen::Vector2d keypoint_;
  const double sigma_px_;
  const AdjustedPose* pose_;
};

}  // namespace adasfm
