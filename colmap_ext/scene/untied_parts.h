// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/relative_pose_prior.h"
#include "core/types.h"

namespace adasfm {

// With fewer points an image's pose is unknown.
inline constexpr size_t kMinNumPointsOfPose = 6;

// Finds the parts of a model whose position and scale relative to the rest are
// unconstrained: the adjustment left hardly any point that both sides see, and
// no sensor measured a motion between them. At most rotations, for example of a
// gyroscope, connect such parts.
//
// Inputs: a model; priors between its images (others are ignored).
// Method: images are tied by 6 common points, counted between neighbours of a
// point's track by image id, or by a prior of the whole motion; groups of tied
// images are joined by 6 points that both see. Returns the groups that see at
// least 15 points, except the largest group, largest first: smaller ones are no
// model.
std::vector<std::set<image_t>> FindUntiedParts(
    const std::vector<RelativePosePrior>& priors,
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
