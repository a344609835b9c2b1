// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Sigmas hold for all steps together, as the chain lets them persist: they are
// the drift of visual odometry, not the noise of one pair.
struct VisualStepOptions {
  bool enabled = true;
  // Pairs at most this many steps apart tell how long the steps are.
  int max_num_steps = 10;
  // 1 sigma of a visual step's length, as a ratio, and of its direction.
  double length_error_ratio = 0.1;
  double direction_error_deg = 1.0;
  // 1 sigma, per axis, of the rotation of a visual step.
  double rotation_error_deg = 0.3;
  // 1 sigma of the change of scale at each step where there are no priors to
  // hold it (OdometryChainOptions::scale_drift_ratio).
  double scale_drift_ratio = 0.01;
  // RejectVisualOdometry: the share of the pairs within a run of visual
  // odometry that may contradict the chain.
  double max_contradicting_ratio = 0.05;

  bool IsValid(std::string* error) const;
};

struct VisualSteps {
  // The priors given, with what they lacked, and then visual steps where there
  // was no prior.
  std::vector<RelativePosePrior> priors;
  // Of the edges of the graph, in the unit of the priors' translations.
  EdgeLengths lengths;
  // In which the translations are: 1 where they are metres, else the median
  // length of a step.
  double unit_m = 1.0;
  int num_by_vision = 0;
};

// Completes the odometry for the gating of loops. Where a step of the chain has
// no position (an IMU without wheels, wheels that end) vision gives direction
// and length, in metres as far as metres of other steps spread through shared
// points, else in a unit of the scene. Where the chain is interrupted (a gap of
// the logs) or there is none, neighbours in the order of capture continue it
// that share a pair. The result serves to exclude pairs and never
// as an edge. known_lengths_m: metres of the priors' pairs, as for
// EstimateEdgeLengths. frame_priors: as for OdometryChain; followers make no
// steps.
VisualSteps AddVisualSteps(
    const VisualStepOptions& options, const EdgeLengthOptions& length_options,
    const ViewGraph& graph, const GlobalCorrespondences& correspondences,
    const std::map<ImagePair, double>& known_lengths_m,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<RelativePosePrior>& frame_priors = {});

}  // namespace adasfm
