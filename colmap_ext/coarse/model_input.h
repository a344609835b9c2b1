// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/coarse/global_stage.h"

namespace adasfm {

// The input of BuildCoarseModel from poses of a result of the stage: its priors
// and lenses. The matches and the unit stay to be set.
CoarseModelInput CreateModelInput(const GlobalStageOptions& options,
                                  const GlobalStageResult& result,
                                  std::map<image_t, Rigid3d> cams_from_world);

}  // namespace adasfm
