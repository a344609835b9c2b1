// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/inertial_motion.h"
#include "global/calibration/correct_camera_mount.h"

namespace adasfm {

// The scene's motions in the true camera frame; camera_mount: that from the
// frame that they are stated in.
std::vector<InertialMotion> MotionsOfCamera(
    const SceneData& scene, const CameraMountReport& camera_mount);

// Scales an adjusted model without metres to those of the accelerometer, where
// it tells them (EstimateInertialScale); else the model stays as it is. Returns
// the lengths of the scene's priors in the model, by which the mapper gives its
// own model the unit (KeepInertialUnit). They are not to hold the shape, which
// vision knows better: all of them together tell the size to 100 %. Bridges
// (BridgeGaps) are to hold it.
std::vector<InertialLength> MeasureSize(
    const SceneData& scene, const CameraMountReport& camera_mount,
    const std::map<ImagePair, Eigen::Matrix3d>& bridges, CoarseModel* model);

}  // namespace adasfm
