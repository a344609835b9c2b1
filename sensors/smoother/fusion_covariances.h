// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sensors/smoother/chain_problem.h"

namespace adasfm {

// Fills the result's motions and sigmas, and its comparison of residuals with
// the stated noise, at the solution. The covariances are the exact marginals of
// the linearised problem, widened where residuals of neighbouring links are
// correlated (sensors/smoother/shared_uncertainty.h). There must be a link.
void FillCovariances(const ChainProblem& chain, OdometryFusionResult* result);

}  // namespace adasfm
