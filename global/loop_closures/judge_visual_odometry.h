// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/visual_odometry.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Both functions compare visual odometry with the pairs within it, 2 to
// kMaxNumVisualSteps odometry edges long, by chi-square tests against the
// chain. A run is a sequence of consecutive odometry edges.

// Rejects visual odometry that its own pairs contradict: photos in any order
// must exclude no pair, while a drive that was filmed in order keeps its chain.
// steps->priors from num_sensor_priors on are by vision alone. A run of these
// is rejected when more than 5 % of the pairs within it fail the test. Returns
// the number of odometry edges rejected.
int RejectVisualOdometry(const LoopClosureOptions& loop_options,
                         const OdometryChainOptions& chain_options,
                         const ViewGraph& graph, size_t num_sensor_priors,
                         VisualOdometryEdges* steps);

// Scales the sigmas of what vision gave to `given`, the priors that
// AddVisualOdometry completed, and of the steps that it added. The ratio is the
// least of 1, 0.7, 0.5 and 0.35 at which at most 5 % of the pairs are excluded
// at the 5 % level, and 1 where there are less than 50 pairs. Returns it.
double FitVisualSigmas(const std::vector<RelativePosePrior>& given,
                       const OdometryChainOptions& chain_options,
                       const ViewGraph& graph, VisualOdometryEdges* steps);

}  // namespace adasfm
