// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/judge_visual_odometry.h"

#include <algorithm>
#include <map>
#include <set>

#include "global/loop_closures/pair_motion.h"

namespace adasfm {
namespace {

// The share of the pairs within a run of visual odometry that may contradict
// the chain. Of unordered photos 30 % do, of a hand-held camera's 2 %, of
// KITTI's drives none, of drives of two simulations at most 3.3 %.
constexpr double kMaxContradictingRatio = 0.05;

// Tried in this order. Short pairs do not show all errors of a chain, such as
// those of a calibration; KITTI's would fit a ratio of 0.05.
constexpr double kSigmaRatios[] = {1.0, 0.7, 0.5, 0.35};
// Where sigmas are right, this share of the pairs is excluded at this level.
constexpr double kFitSignificance = 0.05;
constexpr int kMinNumFittedPairs = 50;

// The odometry edges of the priors k with is_visual(k), each with the first one
// of its run. An edge is named by the chain's index of
// its later image.
template <typename Predicate>
std::map<int, int> FindRuns(const OdometryChain& chain,
                            const std::vector<RelativePosePrior>& priors,
                            const Predicate& is_visual) {
  std::set<int> edges;
  for (size_t k = 0; k < priors.size(); ++k) {
    if (is_visual(k)) edges.insert(chain.Index(priors[k].image_id2));
  }
  std::map<int, int> run_of;
  for (const int edge : edges) {
    const auto previous = run_of.find(edge - 1);
    run_of[edge] = previous == run_of.end() ? edge : previous->second;
  }
  return run_of;
}

struct Tally {
  int num_pairs = 0;
  int num_contradicting = 0;
};

// By run, its pairs and those that the chain excludes.
std::map<int, Tally> TestShortPairs(const OdometryChain& chain,
                                    const std::map<int, int>& run_of,
                                    const ViewGraph& graph,
                                    const VisualOdometryEdges& steps,
                                    double significance) {
  std::map<int, Tally> tallies;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewGraphEdge& edge = graph.edges[e];
    if (!edge.IsKept() || !edge.has_rotation ||
        edge.source == EdgeSource::kSensor ||
        !chain.IsConnected(edge.image_id1, edge.image_id2)) {
      continue;
    }
    const auto [begin, end] =
        std::minmax({chain.Index(edge.image_id1), chain.Index(edge.image_id2)});
    const auto first = run_of.find(begin + 1);
    const auto last = run_of.find(end);
    if (end - begin < 2 || end - begin > kMaxNumVisualSteps ||
        first == run_of.end() || last == run_of.end() ||
        first->second != last->second) {
      continue;
    }
    const ChiSquare pose = TestByOdometry(
        chain, edge, MeasurePair(edge, steps.lengths.lengths[e], steps.unit_m));
    if (pose.dof == 0) continue;
    Tally& tally = tallies[first->second];
    ++tally.num_pairs;
    tally.num_contradicting += pose.Probability() < significance;
  }
  return tallies;
}

}  // namespace

int RejectVisualOdometry(const LoopClosureOptions& loop_options,
                         const OdometryChainOptions& chain_options,
                         const ViewGraph& graph, size_t num_sensor_priors,
                         VisualOdometryEdges* steps) {
  const OdometryChain chain(steps->priors, chain_options);
  const std::map<int, int> run_of = FindRuns(
      chain, steps->priors, [=](size_t k) { return k >= num_sensor_priors; });
  std::map<int, Tally> tallies =
      TestShortPairs(chain, run_of, graph, *steps, loop_options.significance);
  const auto is_rejected = [&](const RelativePosePrior& prior) {
    const Tally& tally = tallies[run_of.at(chain.Index(prior.image_id2))];
    return tally.num_contradicting > kMaxContradictingRatio * tally.num_pairs;
  };
  const auto rejected =
      std::remove_if(steps->priors.begin() + num_sensor_priors,
                     steps->priors.end(), is_rejected);
  const int num_rejected = static_cast<int>(steps->priors.end() - rejected);
  steps->priors.erase(rejected, steps->priors.end());
  return num_rejected;
}

double FitVisualSigmas(const std::vector<RelativePosePrior>& given,
                       const OdometryChainOptions& chain_options,
                       const ViewGraph& graph, VisualOdometryEdges* steps) {
  const auto has_visual_position = [&](size_t k) {
    return k >= given.size() || !given[k].HasMotion();
  };
  double fitted = 1.0;
  for (const double ratio : kSigmaRatios) {
    std::vector<RelativePosePrior> priors = steps->priors;
    ScaleVisualSigmas(given, ratio, &priors);
    const OdometryChain chain(priors, chain_options);
    Tally all;
    for (const auto& [run, tally] :
         TestShortPairs(chain, FindRuns(chain, priors, has_visual_position),
                        graph, *steps, kFitSignificance)) {
      all.num_pairs += tally.num_pairs;
      all.num_contradicting += tally.num_contradicting;
    }
    if (all.num_pairs < kMinNumFittedPairs ||
        all.num_contradicting > kFitSignificance * all.num_pairs) {
      break;
    }
    fitted = ratio;
  }
  ScaleVisualSigmas(given, fitted, &steps->priors);
  return fitted;
}

}  // namespace adasfm
