// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <utility>

#include "colmap_ext/coarse/global_stage.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {

// 90 m of road.
inline SyntheticWorldOptions SmallWorld() {
  SyntheticWorldOptions options;
  options.num_images = 60;
  return options;
}

inline GlobalStageResult RunStage(SceneData scene,
                                  const GlobalStageOptions& options = {}) {
  StatusOr<GlobalStageResult> result = RunGlobalStage(options, &scene);
  EXPECT_TRUE(result.ok()) << result.status().message();
  return std::move(result).value();
}

}  // namespace adasfm
