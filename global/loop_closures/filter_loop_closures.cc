// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/filter_loop_closures.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "core/option_checker.h"
#include "global/loop_closures/consistent_sets.h"
#include "global/loop_closures/drive_parts.h"
#include "global/loop_closures/loop_groups.h"
#include "global/loop_closures/pair_motion.h"

namespace adasfm {
namespace {

// Sets that are grown, from the heaviest loops.
constexpr int kMaxNumSeeds = 20;
// Loops whose consistency is tested, the heaviest ones: two million cycles,
// some seconds. The odometry's test must do for the others.
constexpr size_t kMaxNumLoops = 2000;

class LoopClosureFilter {
 public:
  LoopClosureFilter(const LoopClosureOptions& options,
                    const DriveOdometry& odometry, ViewGraph* graph)
      : options_(options), odometry_(odometry), graph_(*graph) {}

  LoopClosureReport Run() {
    report_.joins_were_split = options_.split_unverified_joins;
    MeasurePairs();
    TestPairsByOdometry();
    parts_ =
        FindDriveParts(options_, odometry_.priors, odometry_.chain, graph_);
    for (const int num_images : parts_.num_images) {
      report_.num_parts += num_images >= kMinNumPartImages;
    }
    std::vector<bool> is_excluded;
    for (const EdgeRemoval removal : removals_) {
      is_excluded.push_back(removal != EdgeRemoval::kKept);
    }
    std::map<std::array<int, 4>, std::vector<int>> edges_of;
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      const auto parts = PartsOf(e);
      if (has_pair_[e] && (parts.first != parts.second || IsLoop(e))) {
        const auto pieces = PiecesOf(e);
        edges_of[{parts.first, parts.second, pieces.first, pieces.second}]
            .push_back(e);
      }
    }
    for (const auto& [key, edges] : edges_of) {
      const std::vector<LoopGroup> groups =
          GroupLoops(options_, odometry_.chain, graph_, parts_, pairs_,
                     is_excluded, edges, UnitLogSigma({key[0], key[1]}));
      if (key[0] == key[1]) {
        FilterLoops(groups);
      } else {
        FilterJoin({key[0], key[1]}, groups);
      }
    }
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      if (graph_.edges[e].IsKept()) graph_.edges[e].removal = removals_[e];
    }
    return report_;
  }

 private:
  bool IsLoop(int e) const {
    return graph_.CaptureGap(graph_.edges[e]) > options_.max_sequence_gap;
  }

  std::pair<int, int> PartsOf(int e) const {
    const ViewGraphEdge& edge = graph_.edges[e];
    return std::minmax(parts_.part_of[graph_.IndexOf(edge.image_id1)],
                       parts_.part_of[graph_.IndexOf(edge.image_id2)]);
  }

  // Of the odometry: loops between other pieces are consistent with each other
  // as far as anybody knows. Joins are looked at between whole parts.
  std::pair<int, int> PiecesOf(int e) const {
    const auto parts = PartsOf(e);
    if (parts.first != parts.second) return {0, 0};
    return std::minmax({odometry_.chain.Piece(graph_.edges[e].image_id1),
                        odometry_.chain.Piece(graph_.edges[e].image_id2)});
  }

  void MeasurePairs() {
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      const ViewGraphEdge& edge = graph_.edges[e];
      has_pair_.push_back(edge.IsKept() && edge.has_rotation &&
                          edge.source != EdgeSource::kSensor);
      pairs_.push_back(has_pair_[e] ? MeasurePair(options_, edge,
                                                  odometry_.lengths.at(e),
                                                  odometry_.unit)
                                    : PairMotion());
    }
  }

  // 1.
  void TestPairsByOdometry() {
    removals_.assign(graph_.edges.size(), EdgeRemoval::kKept);
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      if (!has_pair_[e]) continue;
      const ChiSquare pose =
          TestByOdometry(odometry_.chain, graph_.edges[e], pairs_[e]);
      report_.num_tested += pose.dof > 0;
      if (pose.Probability() >= options_.significance) continue;
      ++report_.num_contradicting;
      removals_[e] =
          IsLoop(e) ? EdgeRemoval::kOdometry : EdgeRemoval::kOdometryPose;
    }
  }

  // By group, those that are left after step 1.
  std::vector<int> CountPairs(const std::vector<LoopGroup>& groups) const {
    std::vector<int> counts;
    for (const LoopGroup& group : groups) {
      counts.push_back(std::count_if(
          group.edges.begin(), group.edges.end(),
          [this](int e) { return removals_[e] == EdgeRemoval::kKept; }));
    }
    return counts;
  }

  // Returns how many pairs it removed.
  int Remove(const LoopGroup& group, EdgeRemoval removal) {
    int num_removed = 0;
    for (const int e : group.edges) {
      if (removals_[e] != EdgeRemoval::kKept) continue;
      removals_[e] = removal;
      ++num_removed;
    }
    return num_removed;
  }

  // The unit of parts without metres is not known.
  double UnitLogSigma(const std::pair<int, int>& parts) const {
    const auto [first, second] = parts;
    return first == second ||
                   (parts_.is_metric[first] && parts_.is_metric[second])
               ? 0.0
               : options_.unit_log_sigma;
  }

  // Sets of consistent groups, heaviest first. Groups without a common odometry
  // count as consistent or not.
  std::vector<std::vector<int>> FindSets(const std::vector<LoopGroup>& groups,
                                         double unit_log_sigma,
                                         bool without_odometry) const {
    ConsistencyMatrix is_consistent(groups.size(),
                                    std::vector<bool>(groups.size(), true));
    for (size_t a = 0; a < groups.size(); ++a) {
      for (size_t b = a + 1; b < groups.size(); ++b) {
        is_consistent[a][b] = is_consistent[b][a] =
            AreConsistent(options_, odometry_.chain, graph_, groups[a],
                          groups[b], unit_log_sigma)
                .value_or(without_odometry);
      }
    }
    return FindConsistentSets(is_consistent, CountPairs(groups), kMaxNumSeeds);
  }

  // 2.
  void FilterLoops(const std::vector<LoopGroup>& all_groups) {
    report_.num_loops += all_groups.size();
    std::vector<LoopGroup> groups;
    const std::vector<int> num_left = CountPairs(all_groups);
    for (size_t g = 0; g < all_groups.size(); ++g) {
      if (2 * num_left[g] > static_cast<int>(all_groups[g].edges.size())) {
        groups.push_back(all_groups[g]);
      } else {
        RemoveLoop(all_groups[g]);
      }
    }
    if (groups.empty()) return;
    std::stable_sort(groups.begin(), groups.end(),
                     [](const LoopGroup& a, const LoopGroup& b) {
                       return a.edges.size() > b.edges.size();
                     });
    if (groups.size() > kMaxNumLoops) groups.resize(kMaxNumLoops);
    const std::vector<int> consistent = FindSets(groups, 0.0, true).front();
    for (size_t g = 0; g < groups.size(); ++g) {
      if (!std::binary_search(consistent.begin(), consistent.end(), g)) {
        RemoveLoop(groups[g]);
        continue;
      }
      for (const int e : groups[g].edges) {
        if (removals_[e] == EdgeRemoval::kOdometry) {
          removals_[e] = EdgeRemoval::kOdometryPose;
        }
      }
    }
  }

  void RemoveLoop(const LoopGroup& group) {
    ++report_.num_false_loops;
    report_.num_pairs_of_false_loops += Remove(group, EdgeRemoval::kFalseLoop);
  }

  // 3.
  void FilterJoin(const std::pair<int, int>& parts,
                  const std::vector<LoopGroup>& groups) {
    std::vector<int> confirmed;
    for (const std::vector<int>& set : FindJoins(parts, groups)) {
      if (!HasTwoPlaces(groups, set)) continue;
      confirmed = set;
      break;
    }
    const UnverifiedJoin join = DescribeJoin(parts, groups);
    if (!confirmed.empty()) {
      ++report_.num_confirmed_joins;
    } else if (join.num_pairs > 0) {
      report_.unverified_joins.push_back(join);
    }
    if (!options_.split_unverified_joins) return;
    for (size_t g = 0; g < groups.size(); ++g) {
      if (std::binary_search(confirmed.begin(), confirmed.end(), g)) continue;
      report_.num_pairs_of_unverified_joins +=
          Remove(groups[g], EdgeRemoval::kUnverifiedJoin);
    }
  }

  // Photos in any order have no odometry that could tell.
  std::vector<std::vector<int>> FindJoins(
      const std::pair<int, int>& parts,
      const std::vector<LoopGroup>& groups) const {
    if (options_.split_unverified_joins) {
      return FindSets(groups, UnitLogSigma(parts), false);
    }
    std::vector<int> all(groups.size());
    std::iota(all.begin(), all.end(), 0);
    return {all};
  }

  bool HasTwoPlaces(const std::vector<LoopGroup>& groups,
                    const std::vector<int>& set) const {
    const std::vector<int> num_pairs = CountPairs(groups);
    for (const int a : set) {
      if (num_pairs[a] < options_.min_num_pairs) continue;
      for (const int b : set) {
        if (num_pairs[b] >= options_.min_num_pairs &&
            parts_.AreApart(options_, groups[a].i, groups[b].i) &&
            parts_.AreApart(options_, groups[a].j, groups[b].j)) {
          return true;
        }
      }
    }
    return false;
  }

  UnverifiedJoin DescribeJoin(const std::pair<int, int>& parts,
                              const std::vector<LoopGroup>& groups) const {
    UnverifiedJoin join;
    join.num_images = std::min(parts_.num_images[parts.first],
                               parts_.num_images[parts.second]);
    int max_num_inliers = -1;
    for (const LoopGroup& group : groups) {
      for (const int e : group.edges) {
        if (removals_[e] != EdgeRemoval::kKept) continue;
        ++join.num_pairs;
        const ViewGraphEdge& edge = graph_.edges[e];
        if (edge.num_inliers <= max_num_inliers) continue;
        max_num_inliers = edge.num_inliers;
        join.image_id1 = edge.image_id1;
        join.image_id2 = edge.image_id2;
      }
    }
    return join;
  }

  const LoopClosureOptions& options_;
  const DriveOdometry& odometry_;
  ViewGraph& graph_;
  DriveParts parts_;
  std::vector<bool> has_pair_;  // by edge
  std::vector<PairMotion> pairs_;
  std::vector<EdgeRemoval> removals_;
  LoopClosureReport report_;
};

}  // namespace

bool LoopClosureOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .Require(significance > 0.0 && significance < 1.0, "significance",
               significance, "must be between 0 and 1")
      .Positive({{"pair_angle_sigma_deg", pair_angle_sigma_deg},
                 {"pair_length_log_sigma", pair_length_log_sigma},
                 {"min_turn_deg", min_turn_deg}})
      .NotNegative({{"unit_log_sigma", unit_log_sigma}})
      .AtLeast(1, "max_sequence_gap", max_sequence_gap)
      .AtLeast(1, "min_num_pairs", min_num_pairs)
      .AllHold();
}

LoopClosureReport FilterLoopClosures(const LoopClosureOptions& options,
                                     const DriveOdometry& odometry,
                                     ViewGraph* graph) {
  std::string error;
  if (!options.IsValid(&error)) {
    throw std::invalid_argument("FilterLoopClosures: " + error);
  }
  if (odometry.lengths.size() != graph->edges.size()) {
    throw std::invalid_argument("FilterLoopClosures: not one length per edge");
  }
  return LoopClosureFilter(options, odometry, graph).Run();
}

}  // namespace adasfm
