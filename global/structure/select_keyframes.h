// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/types.h"
#include "global/view_graph/tracks.h"

namespace adasfm {

// Neighbouring images of a drive see nearly the same. The cost of solving the
// reduced camera system grows with the square of the number of images that see
// a point and, where a drive revisits places, faster than the number of images.
// The first rounds of a large adjustment therefore use points in every few
// images only, and the priors constrain the other images.

// One image of so many is a keyframe. All images as keyframes took 1.4 times as
// long for 2,000 images, with the same error.
inline constexpr int kKeyframeStride = 3;
// Smaller components keep all images: nothing is to be gained.
inline constexpr int kMinNumImagesForKeyframes = 600;

// The images that see points. All other images have priors of rotation,
// direction and length from the image before and to the one after them.
// All of fewer than min_num_images.
std::set<image_t> SelectKeyframes(
    const std::set<image_t>& images, const std::vector<Track>& tracks,
    const std::vector<RelativePosePrior>& priors,
    size_t min_num_images = kMinNumImagesForKeyframes);

}  // namespace adasfm
