// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/consistent_sets.h"

#include <algorithm>
#include <numeric>

namespace adasfm {
namespace {

// Of the candidates, those consistent with one of them, without it.
std::vector<int> SelectConsistent(const ConsistencyMatrix& is_consistent,
                                  const std::vector<int>& candidates, int a) {
  std::vector<int> selected;
  for (const int b : candidates) {
    if (b != a && is_consistent[a][b]) selected.push_back(b);
  }
  return selected;
}

std::vector<int> GrowClique(const ConsistencyMatrix& is_consistent,
                            const std::vector<int>& weights, int seed) {
  std::vector<int> all(weights.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<int> clique = {seed};
  std::vector<int> candidates = SelectConsistent(is_consistent, all, seed);
  // The weight that each candidate keeps possible, itself included.
  std::vector<long> possible(weights.size(), 0);
  for (const int a : candidates) {
    possible[a] = weights[a];
    for (const int b : SelectConsistent(is_consistent, candidates, a)) {
      possible[a] += weights[b];
    }
  }
  while (!candidates.empty()) {
    const int best = *std::max_element(
        candidates.begin(), candidates.end(), [&](int a, int b) {
          return possible[a] < possible[b] ||
                 (possible[a] == possible[b] && a > b);
        });
    clique.push_back(best);
    std::vector<int> left = SelectConsistent(is_consistent, candidates, best);
    for (const int b : candidates) {
      if (b == best || !is_consistent[best][b]) {
        for (const int a : left) {
          if (is_consistent[a][b]) possible[a] -= weights[b];
        }
      }
    }
    candidates = std::move(left);
  }
  std::sort(clique.begin(), clique.end());
  return clique;
}

}  // namespace

std::vector<std::vector<int>> FindConsistentSets(
    const ConsistencyMatrix& is_consistent, const std::vector<int>& weights,
    int max_num_seeds) {
  std::vector<int> seeds(weights.size());
  std::iota(seeds.begin(), seeds.end(), 0);
  std::stable_sort(seeds.begin(), seeds.end(),
                   [&](int a, int b) { return weights[a] > weights[b]; });
  seeds.resize(std::min<size_t>(seeds.size(), max_num_seeds));
  std::vector<std::pair<long, std::vector<int>>> weighted;
  for (const int seed : seeds) {
    std::vector<int> clique = GrowClique(is_consistent, weights, seed);
    long weight = 0;
    for (const int a : clique) weight += weights[a];
    weighted.emplace_back(weight, std::move(clique));
  }
  std::stable_sort(
      weighted.begin(), weighted.end(),
      [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::vector<int>> cliques;
  for (auto& [weight, clique] : weighted) {
    if (std::find(cliques.begin(), cliques.end(), clique) == cliques.end()) {
      cliques.push_back(std::move(clique));
    }
  }
  return cliques;
}

}  // namespace adasfm
