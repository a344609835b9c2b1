// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Pairs at most this many steps apart determine the lengths of steps, and judge
// them (global/loop_closures/judge_visual_odometry.h).
inline constexpr int kMaxNumVisualSteps = 10;
// 1 sigma of the change of scale at each step where no priors constrain the
// scale (OdometryChainOptions::scale_drift_ratio). With 1.5 % a drive of 1,000
// images with aliased places folds.
inline constexpr double kVisualScaleDriftRatio = 0.01;

struct VisualOdometryEdges {
  // The priors given, completed by vision, and then visual odometry edges where
  // there was no prior.
  std::vector<RelativePosePrior> priors;
  // Of the edges of the graph, in the unit of the priors' translations.
  EdgeLengths lengths;
  // A typical length in the unit of the translations: 1 where they are metres,
  // else the median length of a step.
  double unit_m = 1.0;
  int num_by_vision = 0;
};

// Completes the odometry for the consistency check of loop closures. Where a
// step of the chain has no position (an IMU without wheels, wheels that end),
// vision gives direction and length, in metres as far as metres of other steps
// spread through shared points, else in a unit of the scene. Where the chain is
// interrupted (a gap of the logs) or missing, neighbours in the order of
// capture that share a pair continue it. The result serves to reject pairs and
// never as an edge. known_lengths_m: metres of the priors' pairs, as for
// EstimateEdgeLengths. frame_priors: as for OdometryChain; followers get no
// steps.
VisualOdometryEdges AddVisualOdometry(
    int num_threads, const ViewGraph& graph,
    const GlobalCorrespondences& correspondences,
    const std::map<ImagePair, double>& known_lengths_m,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<RelativePosePrior>& frame_priors = {});

// Scales the sigmas of what vision gave: of the steps from given.size() on, and
// of the parts that `given`, the priors that AddVisualOdometry completed, lack.
void ScaleVisualSigmas(const std::vector<RelativePosePrior>& given,
                       double ratio, std::vector<RelativePosePrior>* steps);

}  // namespace adasfm
