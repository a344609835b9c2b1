// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/types.h"
#include "global/structure/match_refinement.h"

namespace adasfm {

// The pair of images with which COLMAP's incremental mapper best begins.
struct MapperStart {
  ImagePair pair;
  int num_matches = 0;
  // Median over the matches.
  double parallax_rad = 0.0;
  // Whether the mapper must be told: no pair of the model is what it looks for
  // by default (100 matches, parallax of 16 deg, not straight ahead). It then
  // relaxes its demands until it takes a pair of almost no parallax for a plane
  // seen with much, and what begins so may end bent
  // (docs/guide/cleaner.md#where-to-begin).
  bool must_be_told = false;
};

// What: among the refined pairs with at least 100 matches the one that says
// most about depth: matches times squared parallax, to which the inverse
// variance of depths is proportional, where more than 16 deg counts as that.
// None without such a pair. Inputs: refined pairs of one model; removed ones
// are passed over.
std::optional<MapperStart> FindMapperStart(
    const std::vector<RefinedPair>& pairs);

}  // namespace adasfm
