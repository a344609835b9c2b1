// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/sim3d.h"

namespace adasfm {

// The unit vector, in the reconstruction's world, that most of its images call
// down: the geometric median of their gravity directions, which a minority of
// wrong ones does not move. None when no registered image knows gravity. The
// cameras are turned by camera_mount against those that the scene states
// (CameraMountReport).
std::optional<Eigen::Vector3d> FindGravityInWorld(
    const SceneData& scene, const colmap::Reconstruction& reconstruction,
    const Eigen::Quaterniond& camera_mount = Eigen::Quaterniond::Identity());

// The same of poses.
std::optional<Eigen::Vector3d> FindGravityInWorld(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world,
    const Eigen::Quaterniond& camera_mount = Eigen::Quaterniond::Identity());

// Moves poses and points into another world.
void TransformReconstruction(const Sim3d& new_from_old,
                             colmap::Reconstruction* reconstruction);

// Turns the world, by the smallest turn, so that gravity points along -z, and
// moves its origin to the registered camera of the lowest id. False, and
// nothing is changed, when no image knows gravity.
bool AlignToGravity(
    const SceneData& scene, colmap::Reconstruction* reconstruction,
    const Eigen::Quaterniond& camera_mount = Eigen::Quaterniond::Identity());

}  // namespace adasfm
