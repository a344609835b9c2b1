// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/inertial_motion.h"

namespace adasfm {

// Scales an adjusted model without metres to those of the accelerometer, where
// it tells them (EstimateInertialScale); else the model stays as it is.
// camera_mount: the true camera frame from that of the scene's motions. Returns
// the lengths of the scene's priors in the model, by which the mapper gives its
// own model the unit (KeepInertialUnit). They are not to hold the shape, which
// vision knows better: all of them together tell the size to 100 %.
std::vector<InertialLength> MeasureSize(const SceneData& scene,
                                        const Eigen::Quaterniond& camera_mount,
                                        CoarseModel* model);

}  // namespace adasfm
