// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/sim3d.h"

namespace adasfm {

// The unit vector of gravity in the reconstruction's world: the geometric
// median of the images' gravity directions, which a minority of wrong
// directions does not change. None when no registered image has a gravity
// direction.
std::optional<Eigen::Vector3d> FindGravityInWorld(
    const SceneData& scene, const colmap::Reconstruction& reconstruction);

// The same for poses.
std::optional<Eigen::Vector3d> FindGravityInWorld(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world);

// Transforms poses and points into another world frame.
void TransformReconstruction(const Sim3d& new_from_old,
                             colmap::Reconstruction* reconstruction);

// Rotates the world, by the smallest angle, so that gravity points along -z,
// and moves its origin to the registered camera of the lowest id. False, and
// nothing is changed, when there is no gravity direction.
bool AlignToGravity(const SceneData& scene,
                    colmap::Reconstruction* reconstruction);

}  // namespace adasfm
