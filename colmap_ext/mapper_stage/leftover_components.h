// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/mapper_stage/map_components.h"

namespace adasfm {

// Adds components of the images that finished models have left out of their
// coarse models, to be mapped by themselves. A coarse model may join trajectory
// segments by a guess that neither points nor sensors confirm in the end; the
// finished model is then the largest segment. Images that verified matches tie
// to each other make a component, where there are enough of them. It begins at
// their coarse poses, with the cameras of the finished model. Their images are
// removed from the components that they come from.
void TakeLeftovers(const std::vector<MappedComponent>& mapped,
                   std::vector<ComponentToMap>* components);

}  // namespace adasfm
