// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "global/loop_closures/filter_loops_by_odometry.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

enum class OdometryVerdict { kUntested, kAgrees, kOpen, kContradicts };

// How one pair stands to the chain. Discrepancies in sigmas of both together;
// negative when they could not be tested.
struct OdometryTest {
  OdometryVerdict verdict = OdometryVerdict::kUntested;
  double rotation_sigmas = -1.0;
  double position_sigmas = -1.0;
  // OdometryChain::Index of the images, the smaller first.
  int begin = 0;
  int end = 0;
};

// The pair's relative rotation, and its relative position when its length is
// known in the chain's unit, against the chain's propagated covariance. Removed
// edges, sensors' and those without a rotation stay untested.
OdometryTest TestByOdometry(const LoopFilterOptions& options,
                            const OdometryChain& chain,
                            const std::optional<EdgeLength>& length,
                            const ViewGraphEdge& edge);

}  // namespace adasfm
