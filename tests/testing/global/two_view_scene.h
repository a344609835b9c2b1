// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "core/rigid3d.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// What two images see of a street: facades on both sides with relief, the same
// on the right side only, or one exact plane on the right.
enum class TwoViewLayout { kBothSides, kOneSide, kPlane };

std::string ToString(TwoViewLayout layout);

struct TwoViewSceneOptions {
  TwoViewLayout layout = TwoViewLayout::kBothSides;
  int num_matches = 150;
  double noise_px = 0.5;
  // Share of wrong matches. Their second keypoint is anywhere in the image that
  // verification allows: up to max_outlier_px off the true epipolar geometry.
  double outlier_ratio = 0.0;
  double max_outlier_px = 4.0;
  double step_m = 1.0;  // forwards
};

// Images 1 and 2 of a pinhole camera of 700 px focal length.
struct TwoViewScene {
  Rigid3d cam2_from_cam1;  // |translation| = step_m
  GlobalCorrespondences correspondences;
  ViewGraph graph;  // one edge; the true pose, unit translation
};

TwoViewScene BuildTwoViewScene(const TwoViewSceneOptions& options,
                               uint64_t seed);

}  // namespace adasfm
