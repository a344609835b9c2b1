// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/drop_contradicted_steps.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "global/loop_closures/test_by_odometry.h"

namespace adasfm {
namespace {

// The short pairs and, of every step, those across it. A step is named by the
// chain's index of its later image.
class StepVotes {
 public:
  void Add(const OdometryTest& test) {
    for (int step = test.begin + 1; step <= test.end; ++step) {
      pairs_across_[step].push_back(pairs_.size());
    }
    pairs_.push_back(
        {test.begin, test.end, test.verdict == OdometryVerdict::kContradicts});
  }

  // Of the steps, the one with the largest share of contradicting pairs, the
  // most pairs, the first; none when no share is above max_ratio.
  std::optional<int> FindWorst(const std::set<int>& steps,
                               double max_ratio) const {
    std::optional<int> worst;
    std::tuple<double, int> most(max_ratio, 0);
    for (const int step : steps) {
      const auto across = pairs_across_.find(step);
      if (across == pairs_across_.end()) continue;
      int num_contradicting = 0;
      for (const int pair : across->second) {
        num_contradicting += pairs_[pair].contradicts;
      }
      const double ratio =
          static_cast<double>(num_contradicting) / across->second.size();
      if (ratio > max_ratio && std::tie(ratio, num_contradicting) > most) {
        most = {ratio, num_contradicting};
        worst = step;
      }
    }
    return worst;
  }

  // Drops the pairs across a step.
  void Settle(int step) {
    const std::vector<int> settled = pairs_across_.at(step);
    for (const int pair : settled) {
      pairs_[pair].is_settled = true;
      for (int s = pairs_[pair].begin + 1; s <= pairs_[pair].end; ++s) {
        std::vector<int>& across = pairs_across_.at(s);
        across.erase(std::find(across.begin(), across.end(), pair));
        if (across.empty()) pairs_across_.erase(s);
      }
    }
  }

  // The share of contradicting pairs among those that are left between two
  // indices; 0 without any.
  double ContradictingRatio(int begin, int end) const {
    int num_pairs = 0;
    int num_contradicting = 0;
    for (const ShortPair& pair : pairs_) {
      if (pair.is_settled || pair.begin < begin || pair.end > end) continue;
      ++num_pairs;
      num_contradicting += pair.contradicts;
    }
    return num_pairs == 0 ? 0.0
                          : static_cast<double>(num_contradicting) / num_pairs;
  }

 private:
  struct ShortPair {
    int begin = 0;
    int end = 0;
    bool contradicts = false;
    bool is_settled = false;
  };
  std::vector<ShortPair> pairs_;
  std::map<int, std::vector<int>> pairs_across_;
};

StepVotes CollectVotes(const VisualStepOptions& options,
                       const LoopFilterOptions& loop_options,
                       const ViewGraph& graph, const OdometryChain& chain,
                       const EdgeLengths& lengths) {
  StepVotes votes;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const OdometryTest test = TestByOdometry(
        loop_options, chain,
        lengths.metric ? lengths.lengths.at(e) : std::optional<EdgeLength>(),
        graph.edges[e]);
    const int num_steps = test.end - test.begin;
    if (test.verdict != OdometryVerdict::kUntested && num_steps >= 2 &&
        num_steps <= options.max_num_steps) {
      votes.Add(test);
    }
  }
  return votes;
}

// The runs of steps that follow each other.
std::vector<std::vector<int>> FindRuns(const std::set<int>& steps) {
  std::vector<std::vector<int>> runs;
  for (const int step : steps) {
    if (runs.empty() || step != runs.back().back() + 1) runs.emplace_back();
    runs.back().push_back(step);
  }
  return runs;
}

}  // namespace

int DropContradictedSteps(const VisualStepOptions& options,
                          const LoopFilterOptions& loop_options,
                          const OdometryChainOptions& chain_options,
                          const ViewGraph& graph, size_t num_sensor_priors,
                          VisualSteps* steps) {
  const OdometryChain chain(steps->priors, chain_options);
  StepVotes votes =
      CollectVotes(options, loop_options, graph, chain, steps->lengths);
  std::set<int> candidates;
  for (size_t k = num_sensor_priors; k < steps->priors.size(); ++k) {
    candidates.insert(chain.Index(steps->priors[k].image_id2));
  }
  std::set<int> dropped;
  while (const auto worst =
             votes.FindWorst(candidates, options.max_contradicting_ratio)) {
    votes.Settle(*worst);
    candidates.erase(*worst);
    dropped.insert(*worst);
  }
  for (const std::vector<int>& run : FindRuns(candidates)) {
    if (votes.ContradictingRatio(run.front() - 1, run.back()) >
        options.max_run_contradicting_ratio) {
      dropped.insert(run.begin(), run.end());
    }
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
