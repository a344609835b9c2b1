// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/model_input.h"

#include <utility>

namespace adasfm {

CoarseModelInput CreateModelInput(const GlobalStageOptions& options,
                                  const GlobalStageResult& result,
                                  std::map<image_t, Rigid3d> cams_from_world) {
  CoarseModelInput input;
  input.priors = result.poses.priors;
  input.cams_from_world = std::move(cams_from_world);
  input.refine_lenses = options.structure.refine_unknown_focal_length &&
                        !result.focal_lengths.empty();
  return input;
}

}  // namespace adasfm
