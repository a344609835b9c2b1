// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/mapper_stage/map_components.h"

namespace adasfm {

// What finished models have left out of their coarse models, to be mapped by
// itself: a coarse model may join stretches of a drive by a guess that neither
// points nor sensors confirm in the end, and the largest stretch is the model
// then. Images that verified matches tie to each other make a component, where
// there are enough of them; it begins at their coarse poses, with the cameras
// that the finished model has found. Those components are added, and the ones
// that they come from are without them.
void TakeLeftovers(const std::vector<MappedComponent>& mapped,
                   std::vector<ComponentToMap>* components);

}  // namespace adasfm
