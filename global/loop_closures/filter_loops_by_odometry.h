// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct LoopFilterOptions {
  bool enabled = true;
  // A pair contradicts the chain beyond this many sigmas of both together.
  double max_num_sigmas = 5.0;
  // Least errors granted to a pair's own pose, added to its sigmas.
  double min_rotation_error_deg = 2.0;
  double min_direction_error_deg = 3.0;
  // Share of a visual length that may be wrong, and metres that always may.
  double length_error_ratio = 0.15;
  double min_position_error_m = 0.3;
  // Pairs whose both ends lie within so many steps of another's are its
  // neighbours.
  int max_group_gap = 4;
  // A pair that the chain neither confirms nor excludes goes when more than
  // this share of its decided neighbours contradict the chain: a run of pairs
  // is one false loop, not fifty votes. It goes too when it has no neighbours.
  double max_contradicting_ratio = 0.5;

  bool IsValid(std::string* error) const;
};

struct LoopFilterReport {
  int num_tested = 0;
  int num_contradicting = 0;
  int num_in_false_runs = 0;
  int num_false_runs = 0;
};

// Removes edges that the odometry chain excludes: relative rotation, and the
// metric relative position where lengths are known, against the chain's
// propagated covariance.
LoopFilterReport FilterLoopsByOdometry(const LoopFilterOptions& options,
                                       const OdometryChain& chain,
                                       const EdgeLengths& lengths,
                                       ViewGraph* graph);

}  // namespace adasfm
