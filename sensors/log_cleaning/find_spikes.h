// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/types.h"

namespace adasfm {

// What: marks samples that motion cannot explain.
// Inputs: readings of one sensor in order of time (unused axes zero), the
// median period of the log, and the smallest deviation worth a name (the
// readings' unit). Method: a reading's deviation is its distance from the
// median of the 0.05 s (at least five samples) before and after. Of a spike it
// exceeds min_deviation and 30 times the log's robust standard deviation
// (1.4826 medians), and the samples around the spike are quiet: a machine that
// hits a kerb rings, a bit that flips does not. On failure: nothing is marked
// in logs too short to tell (fewer than 50).
std::vector<bool> FindSpikes(const std::vector<Eigen::Vector3d>& readings,
                             double period_s, double min_deviation);

}  // namespace adasfm
