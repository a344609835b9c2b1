// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>

#include "core/types.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Adds pairs of images with nothing in common that pass two-view verification:
// a random pose and 15 to 25 matches that fit it by chance, among more matches
// that do not. Throws std::invalid_argument when the images have too few such
// pairs.
void AddSpuriousPairs(const SyntheticWorld& world, int num_pairs,
                      std::map<ImagePair, SyntheticPair>* pairs);

// Rotates the poses of options.rotation_outlier_ratio of the true pairs.
void SpoilRotations(const SyntheticWorldOptions& options,
                    std::map<ImagePair, SyntheticPair>* pairs);

}  // namespace adasfm
