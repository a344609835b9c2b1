// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/visual_steps.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Gives up the steps that vision alone made (steps->priors from
// num_sensor_priors on) and that its own pairs refute: a step goes when more
// than options.max_contradicting_ratio of the pairs across it, 2 to
// options.max_num_steps steps long, contradict the chain by the chi-square test
// of loop closures, the worst step first, each pair against one step only; and
// a run of steps goes when after that more than
// options.max_run_contradicting_ratio of the pairs within it do. So a drive
// that was filmed in order keeps its chain, while photos in any order and a
// hand-held camera exclude no pair. Returns the number of steps given up.
int DropContradictedSteps(const VisualStepOptions& options,
                          const LoopClosureOptions& loop_options,
                          const OdometryChainOptions& chain_options,
                          const ViewGraph& graph, size_t num_sensor_priors,
                          VisualSteps* steps);

}  // namespace adasfm
