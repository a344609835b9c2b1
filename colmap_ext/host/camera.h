// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/bearing.h"

namespace adasfm {

// Whether all parameters are finite and the focal lengths positive.
bool HasUsableParams(const colmap::Camera& camera);

// The ray of a pixel and its derivative, for every camera model of COLMAP. None
// where the model cannot be inverted: beyond 90 degrees from the axis, or where
// a polynomial distortion is not monotonic.
std::optional<Bearing> ComputeBearing(const colmap::Camera& camera,
                                      const Eigen::Vector2d& pixel);

// One ray per keypoint; direction and Jacobian are zero where there is no ray.
std::vector<Bearing> ComputeBearings(
    const colmap::Camera& camera, const std::vector<Eigen::Vector2d>& pixels);

// None for a point that does not lie in front of the camera.
std::optional<Eigen::Vector2d> ProjectPoint(
    const colmap::Camera& camera, const Eigen::Vector3d& point_in_cam);

}  // namespace adasfm
