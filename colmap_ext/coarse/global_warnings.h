// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"

namespace adasfm {

// Warnings for the user: lost images, a corrected camera-IMU rotation, models
// that contradict sensors, positions or verified pairs, and parts of a model
// that are joined at one place only.
std::vector<std::string> ListGlobalWarnings(const SceneData& scene,
                                            const GlobalStageResult& result);

}  // namespace adasfm
