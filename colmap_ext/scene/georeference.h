// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>

#include "colmap_ext/scene/align_to_positions.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// Whether priors between images of the poses give lengths in metres: priors of
// sensors, or priors within the frames of a rig.
bool HasMetricPriors(const SceneData& scene,
                     const std::map<image_t, Rigid3d>& cams_from_world);

// AlignToPositions for poses of the scene's images, with the scene's positions
// and gravity.
PositionAlignment AlignSceneToPositions(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world,
    bool is_metric);

// Transforms the poses into the frame of the positions.
std::map<image_t, Rigid3d> TransformCamsFromWorld(
    const Sim3d& enu_from_world,
    const std::map<image_t, Rigid3d>& cams_from_world);

// Observations of the vertical for an adjustment with positions: on a straight
// road, or within a few metres, positions alone do not constrain it.
struct Verticals {
  // Unit vectors towards the ground.
  std::map<image_t, Eigen::Vector3d> gravity_in_cam;
  // 1 sigma of the vertical that they constrain together.
  double sigma_rad = 0.0;
};

// The IMU's gravity directions if there are any; else the verticals of the
// given poses, which are in the frame of the positions, with a large sigma.
Verticals FindVerticals(const SceneData& scene,
                        const std::map<image_t, Rigid3d>& cams_from_enu);

// The loss scale (PriorBundleAdjustmentOptions::position_loss_scale) of one of
// num_rounds adjustments: it decreases from what the alignment needed to
// final_scale.
double PositionLossScale(const PositionAlignment& alignment, double final_scale,
                         int round, int num_rounds);

}  // namespace adasfm
