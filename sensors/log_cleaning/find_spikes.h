// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/types.h"

namespace adasfm {

// Marks samples that motion cannot explain. readings: of one sensor in order of
// time (unused axes zero); period_s: the median period of the log;
// min_deviation: the smallest deviation that counts, in the unit of the
// readings. The deviation of a reading is its distance from the median of the
// 0.05 s (at least five samples) before and after. For a spike the deviation
// exceeds min_deviation and 30 times the log's robust standard deviation
// (1.4826 medians), and the samples around the spike are quiet: a machine that
// hits a kerb rings, a flipped bit does not. Nothing is marked in logs that are
// too short (fewer than 50 samples).
std::vector<bool> FindSpikes(const std::vector<Eigen::Vector3d>& readings,
                             double period_s, double min_deviation);

}  // namespace adasfm
