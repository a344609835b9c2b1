// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// What vision measured: every image's keypoints as rays, and the verified
// matches of every pair; indices of a match are (in the smaller id, in the
// larger id).
struct GlobalCorrespondences {
  std::map<image_t, std::vector<Bearing>> bearings;
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
};

}  // namespace adasfm
