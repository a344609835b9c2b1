// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>

#include "colmap_ext/cost_functions/adjusted_pose.h"
#include "colmap_ext/cost_functions/reprojection_cost.h"
#include "colmap_ext/host/colmap.h"

namespace adasfm {

// Folds the camera's intrinsics into a keypoint in px. False when the camera
// model cannot undo its distortion there.
bool NormalizeKeypoint(const colmap::Camera& camera, const Eigen::Vector2d& xy,
                       double sigma_px, NormalizedKeypoint* keypoint);

// The cost whose third parameter are the intrinsics of the camera's model; null
// for a model that COLMAP does not have.
std::unique_ptr<ceres::CostFunction> CreateCameraCost(
    const colmap::Camera& camera, const Eigen::Vector2d& xy, double sigma_px,
    const AdjustedPose* pose);

}  // namespace adasfm
