// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "global/view_graph/view_graph.h"

namespace adasfm {

// Takes the direction of pairs whose images are at one place by what others
// see: with both, most images that have no baseline with either have none
// (ViewGraphEdge::has_baseline). A pair of a standing camera may pass the test
// of its baseline by chance, and an image would hang on its direction alone,
// anywhere. Returns the number of pairs.
int DropDirectionsAtRest(ViewGraph* graph);

}  // namespace adasfm
