// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/consistent_set.h"

#include <algorithm>
#include <numeric>

namespace adasfm {

std::vector<int> FindConsistentSet(const ConsistencyMatrix& is_consistent,
                                   const std::vector<int>& weights) {
  std::vector<int> candidates(weights.size());
  std::iota(candidates.begin(), candidates.end(), 0);
  // The weight that each candidate keeps possible, itself included.
  std::vector<long> possible(weights.begin(), weights.end());
  for (const int a : candidates) {
    for (const int b : candidates) {
      if (a != b && is_consistent[a][b]) possible[a] += weights[b];
    }
  }
  std::vector<int> clique;
  while (!candidates.empty()) {
    const int best = *std::max_element(
        candidates.begin(), candidates.end(),
        [&](int a, int b) { return possible[a] < possible[b]; });
    clique.push_back(best);
    std::vector<int> left;
    for (const int a : candidates) {
      if (a != best && is_consistent[best][a]) left.push_back(a);
    }
    for (const int b : candidates) {
      if (b == best || is_consistent[best][b]) continue;
      for (const int a : left) {
        if (is_consistent[a][b]) possible[a] -= weights[b];
      }
    }
    candidates = std::move(left);
  }
  std::sort(clique.begin(), clique.end());
  return clique;
}

}  // namespace adasfm
