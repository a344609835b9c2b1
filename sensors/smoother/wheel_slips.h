// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/smoother/chain_state.h"
#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Links with grossly wrong wheels, which would distort the first solution, in
// ascending order: links whose initial speeds leave a force that is not gravity
// (jumps), their neighbours, and stretches between two jumps whose speeds
// differ from those of most links by the sum of the jumps.
std::vector<size_t> FindOutlierWheels(const OdometryFusionProblem& problem,
                                      double gravity_m_s2);

// Logged minus true mean speed of link k's wheels, m/s along the motion. 0 for
// a link without duration.
double ComputeWheelSpeedError(const OdometryFusionProblem& problem, size_t k,
                              const ChainState& first, const ChainState& second,
                              const ChainGlobals& globals);

}  // namespace adasfm
