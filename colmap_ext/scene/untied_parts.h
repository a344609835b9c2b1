// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/relative_pose_prior.h"
#include "core/types.h"

namespace adasfm {

// With fewer points nothing is known of an image's pose.
inline constexpr size_t kMinNumPointsOfPose = 6;

// Parts of a model whose place and size against the rest nothing tells: the
// adjustment left hardly any point that both see, and no sensor knows a motion
// between them. Rotations alone, as of a gyroscope, hold them together.
//
// Inputs: a model; priors between its images, those of others are passed over.
// Method. Images are tied by 6 common points, counted between neighbours of a
// point's track by image id, or by a prior of the whole motion; groups of tied
// images by 6 points that both see. Returns the groups but the largest that see
// 15 points or more, largest first: smaller ones are no model.
std::vector<std::set<image_t>> FindUntiedParts(
    const std::vector<RelativePosePrior>& priors,
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
