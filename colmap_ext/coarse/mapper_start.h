// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/types.h"
#include "global/structure/match_refinement.h"

namespace adasfm {

// The best initial pair of images for COLMAP's incremental mapper.
struct MapperStart {
  ImagePair pair;
  int num_matches = 0;
  // Median over the matches.
  double parallax_rad = 0.0;
  // Whether the mapper needs this pair as an option: no pair of the model meets
  // its defaults (100 matches, parallax of 16 deg, not straight ahead). It then
  // relaxes its thresholds until it mistakes a pair of almost no parallax for a
  // plane seen with much, and the model may end deformed
  // (docs/guide/cleaner.md#where-to-begin).
  bool must_be_told = false;
};

// Finds the refined pair, of at least 100 matches, with most information on
// depth: matches times squared parallax, to which the inverse variance of
// depths is proportional. Parallaxes above 16 deg count as 16 deg. None without
// such a pair. Inputs: refined pairs of one model; removed ones are ignored.
std::optional<MapperStart> FindMapperStart(
    const std::vector<RefinedPair>& pairs);

}  // namespace adasfm
