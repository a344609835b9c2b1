// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/visual_odometry.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Rejects visual odometry that its own pairs contradict: photos in any order
// must exclude no pair, while a drive that was filmed in order keeps its chain.
// steps->priors from num_sensor_priors on are by vision alone.
// A run is a sequence of consecutive visual odometry edges. It is rejected when
// more than 5 % of the pairs within it, 2 to kMaxNumVisualSteps edges long,
// fail the chi-square test against the chain. Returns the number of odometry
// edges rejected.
int RejectVisualOdometry(const LoopClosureOptions& loop_options,
                         const OdometryChainOptions& chain_options,
                         const ViewGraph& graph, size_t num_sensor_priors,
                         VisualOdometryEdges* steps);

}  // namespace adasfm
