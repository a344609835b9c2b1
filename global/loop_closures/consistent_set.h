// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace adasfm {

// Which of n measurements are consistent with which: symmetric, by row.
using ConsistencyMatrix = std::vector<std::vector<bool>>;

// Pairwise consistency maximisation (Mangelson et al., ICRA 2018): a set of
// large weight whose measurements are all consistent with each other. weights:
// one per measurement, >= 0. Greedy: each time the measurement that keeps the
// most weight possible is added, the first one of equals. The set is maximal,
// but need not be the maximum. Returns indices in ascending order.
std::vector<int> FindConsistentSet(const ConsistencyMatrix& is_consistent,
                                   const std::vector<int>& weights);

}  // namespace adasfm
