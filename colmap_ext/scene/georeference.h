// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>

#include "colmap_ext/scene/align_to_positions.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// Whether priors between images of the poses tell the metre: those of sensors,
// or those within the frames of a rig.
bool HasMetricPriors(const SceneData& scene,
                     const std::map<image_t, Rigid3d>& cams_from_world);

// AlignToPositions for poses of the scene's images with the scene's positions
// and gravity. The cameras are turned by camera_mount against the scene's
// gravity directions (CameraMountReport).
PositionAlignment AlignSceneToPositions(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world,
    bool is_metric,
    const Eigen::Quaterniond& camera_mount = Eigen::Quaterniond::Identity());

// The poses in the frame of the positions.
std::map<image_t, Rigid3d> TransformCamsFromWorld(
    const Sim3d& enu_from_world,
    const std::map<image_t, Rigid3d>& cams_from_world);

// What an adjustment with positions is told about the vertical: on a straight
// road, or within a few metres, positions alone do not hold it.
struct Verticals {
  // Unit vectors towards the ground.
  std::map<image_t, Eigen::Vector3d> gravity_in_cam;
  // 1 sigma of the vertical that they give together.
  double sigma_rad = 0.0;
};

// The IMU's where there is one; else what the poses, which are in the frame of
// the positions, have now, with a large sigma.
Verticals FindVerticals(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_enu,
    const Eigen::Quaterniond& camera_mount = Eigen::Quaterniond::Identity());

// The loss scale (PriorBundleAdjustmentOptions::position_loss_scale) of one of
// num_rounds adjustments: it falls from what the alignment needed to
// final_scale.
double PositionLossScale(const PositionAlignment& alignment, double final_scale,
                         int round, int num_rounds);

}  // namespace adasfm
