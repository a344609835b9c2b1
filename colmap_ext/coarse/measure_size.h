// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/inertial_motion.h"

namespace adasfm {

// Scales an adjusted model without metres to metres of the accelerometer, where
// that determines them (EstimateInertialScale); else the model is unchanged.
// Returns the lengths of the scene's priors in the model, by which the mapper
// gives its own model the unit (KeepInertialUnit). They must not constrain the
// shape, which vision determines better: all of them together constrain the
// size to 100 % only. Bridges (BridgeGaps) must constrain the shape.
std::vector<InertialLength> MeasureSize(
    const SceneData& scene, const std::map<ImagePair, Eigen::Matrix3d>& bridges,
    CoarseModel* model);

}  // namespace adasfm
