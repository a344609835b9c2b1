// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/types.h"
#include "global/structure/tracks.h"

namespace adasfm {

// Neighbouring images of a drive see nearly the same. The cost of solving the
// reduced camera system grows with the square of the number of images that see
// a point and, where a drive revisits places, faster than the number of images.
// The first rounds of a large adjustment therefore use points in every few
// images only, and the priors constrain the other images.
struct KeyframeOptions {
  // Smaller components keep all images: nothing is to be gained.
  int min_num_images = 600;
  // One image of so many is a keyframe; 1: all are.
  int stride = 3;

  bool IsValid(std::string* error) const;
};

// The images that see points. All other images have priors of rotation,
// direction and length from the image before and to the one after them.
std::set<image_t> SelectKeyframes(const KeyframeOptions& options,
                                  const std::set<image_t>& images,
                                  const std::vector<Track>& tracks,
                                  const std::vector<RelativePosePrior>& priors);

}  // namespace adasfm
