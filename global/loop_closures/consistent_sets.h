// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace adasfm {

// Which of n measurements are consistent with which: symmetric, by row.
using ConsistencyMatrix = std::vector<std::vector<bool>>;

// Pairwise consistency maximisation (Mangelson et al., ICRA 2018): sets of
// measurements all of which are consistent with each other, cliques of the
// consistency graph, the heaviest first. weights: one per measurement, >= 0.
// Each of the max_num_seeds heaviest measurements starts one clique, which
// takes the measurement that keeps the most weight possible until none is left;
// equal ones by their order. Such a clique is maximal, but need not be the
// maximum.
std::vector<std::vector<int>> FindConsistentSets(
    const ConsistencyMatrix& is_consistent, const std::vector<int>& weights,
    int max_num_seeds);

}  // namespace adasfm
