// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/drop_contradicted_steps.h"

#include <algorithm>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "global/loop_closures/pair_motion.h"

namespace adasfm {
namespace {

// A pair of images that follow each other closely. A step is named by the
// chain's index of its later image; begin < step <= end lie across.
struct ShortPair {
  int begin = 0;
  int end = 0;
  bool contradicts = false;
  bool is_settled = false;
};

std::vector<ShortPair> TestShortPairs(const VisualStepOptions& options,
                                      const LoopClosureOptions& loop_options,
                                      const ViewGraph& graph,
                                      const OdometryChain& chain,
                                      const VisualSteps& steps) {
  std::vector<ShortPair> pairs;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewGraphEdge& edge = graph.edges[e];
    if (!edge.IsKept() || !edge.has_rotation ||
        edge.source == EdgeSource::kSensor ||
        !chain.IsConnected(edge.image_id1, edge.image_id2)) {
      continue;
    }
    const auto [begin, end] =
        std::minmax({chain.Index(edge.image_id1), chain.Index(edge.image_id2)});
    if (end - begin < 2 || end - begin > options.max_num_steps) continue;
    const ChiSquare pose =
        TestByOdometry(chain, edge,
                       MeasurePair(loop_options, edge, steps.lengths.lengths[e],
                                   steps.unit_m));
    if (pose.dof == 0) continue;
    pairs.push_back(
        {begin, end, pose.Probability() < loop_options.significance, false});
  }
  return pairs;
}

// The pairs across each step, and how many of them contradict.
class StepVotes {
 public:
  StepVotes(int num_steps, std::vector<ShortPair>* pairs)
      : pairs_(*pairs), votes_(num_steps) {
    for (const ShortPair& pair : pairs_) Count(pair, 1);
  }

  // Of the steps, the one with the largest share of contradicting pairs, the
  // most pairs, the first; none when no share is above max_ratio.
  std::optional<int> FindWorst(const std::set<int>& steps,
                               double max_ratio) const {
    std::optional<int> worst;
    std::tuple<double, int> most(max_ratio, 0);
    for (const int step : steps) {
      const auto& [num_pairs, num_contradicting] = votes_[step];
      if (num_contradicting == 0) continue;
      const double ratio = static_cast<double>(num_contradicting) / num_pairs;
      if (ratio > max_ratio && std::tie(ratio, num_contradicting) > most) {
        most = {ratio, num_contradicting};
        worst = step;
      }
    }
    return worst;
  }

  void Settle(int step) {
    for (ShortPair& pair : pairs_) {
      if (pair.is_settled || pair.begin >= step || pair.end < step) continue;
      pair.is_settled = true;
      Count(pair, -1);
    }
  }

 private:
  void Count(const ShortPair& pair, int sign) {
    for (int step = pair.begin + 1; step <= pair.end; ++step) {
      votes_[step].first += sign;
      votes_[step].second += pair.contradicts ? sign : 0;
    }
  }

  std::vector<ShortPair>& pairs_;
  std::vector<std::pair<int, int>> votes_;
};

// The share of contradicting pairs among those that are left between two
// indices; 0 without any.
double ContradictingRatio(const std::vector<ShortPair>& pairs, int begin,
                          int end) {
  int num_pairs = 0;
  int num_contradicting = 0;
  for (const ShortPair& pair : pairs) {
    if (pair.is_settled || pair.begin < begin || pair.end > end) continue;
    ++num_pairs;
    num_contradicting += pair.contradicts;
  }
  return num_pairs == 0 ? 0.0
                        : static_cast<double>(num_contradicting) / num_pairs;
}

}  // namespace

int DropContradictedSteps(const VisualStepOptions& options,
                          const LoopClosureOptions& loop_options,
                          const OdometryChainOptions& chain_options,
                          const ViewGraph& graph, size_t num_sensor_priors,
                          VisualSteps* steps) {
  const OdometryChain chain(steps->priors, chain_options);
  std::vector<ShortPair> pairs =
      TestShortPairs(options, loop_options, graph, chain, *steps);
  std::set<int> candidates;
  int num_indices = 0;
  for (size_t k = 0; k < steps->priors.size(); ++k) {
    const int step = chain.Index(steps->priors[k].image_id2);
    num_indices = std::max(num_indices, step + 1);
    if (k >= num_sensor_priors && step >= 0) candidates.insert(step);
  }
  std::set<int> dropped;
  StepVotes votes(num_indices, &pairs);
  while (const auto worst =
             votes.FindWorst(candidates, options.max_contradicting_ratio)) {
    votes.Settle(*worst);
    candidates.erase(*worst);
    dropped.insert(*worst);
  }
  // Runs of steps that follow each other.
  for (auto begin = candidates.begin(); begin != candidates.end();) {
    auto end = std::next(begin);
    while (end != candidates.end() && *end == *std::prev(end) + 1) ++end;
    if (ContradictingRatio(pairs, *begin - 1, *std::prev(end)) >
        options.max_run_contradicting_ratio) {
      dropped.insert(begin, end);
    }
    begin = end;
  }
  const auto begin = steps->priors.begin() + num_sensor_priors;
  steps->priors.erase(
      std::remove_if(begin, steps->priors.end(),
                     [&](const RelativePosePrior& prior) {
                       return dropped.count(chain.Index(prior.image_id2)) > 0;
                     }),
      steps->priors.end());
  return static_cast<int>(dropped.size());
}

}  // namespace adasfm
