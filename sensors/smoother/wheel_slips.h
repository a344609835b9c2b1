// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/smoother/chain_state.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Links with grossly wrong wheels, which would pull the first solution far off,
// in ascending order: those whose first speeds leave a force that is not
// gravity, their neighbours, and stretches between two such jumps whose speeds
// are off those of most links by what the jumps add up to.
std::vector<size_t> FindSuspectWheels(const OdometryFusionProblem& problem,
                                      double gravity_m_s2);

// Logged minus true mean speed of link k's wheels, m/s along the motion. 0 for
// a link without duration.
double ComputeWheelSpeedError(const OdometryFusionProblem& problem, size_t k,
                              const ChainState& first, const ChainState& second,
                              const ChainGlobals& globals);

}  // namespace adasfm
