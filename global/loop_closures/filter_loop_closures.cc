// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/filter_loop_closures.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "core/option_checker.h"
#include "global/loop_closures/consistent_set.h"
#include "global/loop_closures/pair_motion.h"
#include "global/loop_closures/trajectory_segments.h"

namespace adasfm {
namespace {

// Number of clusters between two segments that are tested for consistency,
// heaviest first: two million cycles, some seconds. Others are not confirmed.
constexpr size_t kMaxNumClusters = 2000;

// 1 sigma of the log ratio of two segments' units, unless sensors give both
// metres: the scene is as deep there as elsewhere, within a factor of two.
constexpr double kUnitLogSigma = 0.35;

// A pair from image i to image j, indices of ViewGraph::images; i lies in the
// segment of the smaller index or, within a segment, earlier.
struct Closure {
  int i = 0;
  int j = 0;
  PairMotion j_from_i;
};

// Pairs between the same two windows of images.
struct ClosureCluster {
  std::vector<int> edges;
  // Number of edges that the odometry does not contradict, and the best of
  // these: with a length if there are any, with most inliers.
  int num_kept = 0;
  int best_edge = -1;
  Closure best;
};

class LoopClosureFilter {
 public:
  LoopClosureFilter(const LoopClosureOptions& options,
                    const TrajectoryOdometry& odometry, ViewGraph* graph)
      : options_(options),
        odometry_(odometry),
        graph_(*graph),
        segments_(FindTrajectorySegments(options, odometry.priors,
                                         odometry.chain, *graph)) {}

  LoopClosureReport Run() {
    report_.segments_were_split = options_.split_unconfirmed_closures;
    for (const int num_images : segments_.num_images) {
      report_.num_segments += num_images >= kMinNumSegmentImages;
    }
    TestPairsByOdometry();
    std::map<std::pair<int, int>, std::vector<ClosureCluster>> between;
    for (const ClosureCluster& cluster : ClusterClosures()) {
      const auto segments = SegmentsOf(cluster.edges.front());
      if (segments.first == segments.second) {
        Vote(cluster);
      } else {
        between[segments].push_back(cluster);
      }
    }
    for (const auto& [segments, clusters] : between) {
      FilterBetween(segments, clusters);
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

  // The smaller index first.
  std::pair<int, int> SegmentsOf(int e) const {
    const ViewGraphEdge& edge = graph_.edges[e];
    return std::minmax({segments_.segment_of[graph_.IndexOf(edge.image_id1)],
                        segments_.segment_of[graph_.IndexOf(edge.image_id2)]});
  }

  // Rule 1 of FilterLoopClosures.
  void TestPairsByOdometry() {
    removals_.assign(graph_.edges.size(), EdgeRemoval::kKept);
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      const ViewGraphEdge& edge = graph_.edges[e];
      has_pair_.push_back(edge.IsKept() && edge.has_rotation &&
                          edge.source != EdgeSource::kSensor);
      pairs_.emplace_back();
      if (!has_pair_[e]) continue;
      pairs_[e] = MeasurePair(edge, odometry_.lengths[e], odometry_.unit);
      const ChiSquare pose = TestByOdometry(odometry_.chain, edge, pairs_[e]);
      report_.num_tested += pose.dof > 0;
      if (pose.Probability() >= options_.significance) continue;
      ++report_.num_contradicting;
      removals_[e] =
          IsLoop(e) ? EdgeRemoval::kOdometry : EdgeRemoval::kOdometryPose;
    }
  }

  std::vector<ClosureCluster> ClusterClosures() const {
    std::map<std::array<int64_t, 4>, ClosureCluster> clusters;
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      const auto segments = SegmentsOf(e);
      if (!has_pair_[e] || (segments.first == segments.second && !IsLoop(e))) {
        continue;
      }
      const Closure closure = MakeClosure(e);
      // Votes take large windows; between segments one window is one place.
      const int window = segments.first == segments.second
                             ? 2 * options_.max_sequence_gap + 1
                             : options_.max_sequence_gap + 1;
      ClosureCluster& cluster =
          clusters[{segments.first, segments.second,
                    segments_.rank_of[closure.i] / window,
                    segments_.rank_of[closure.j] / window}];
      cluster.edges.push_back(e);
      if (removals_[e] != EdgeRemoval::kKept) continue;
      ++cluster.num_kept;
      if (cluster.best_edge >= 0 && Quality(e) <= Quality(cluster.best_edge)) {
        continue;
      }
      cluster.best_edge = e;
      cluster.best = closure;
    }
    std::vector<ClosureCluster> list;
    for (auto& [key, cluster] : clusters) list.push_back(std::move(cluster));
    return list;
  }

  Closure MakeClosure(int e) const {
    const int i = graph_.IndexOf(graph_.edges[e].image_id1);
    const int j = graph_.IndexOf(graph_.edges[e].image_id2);
    const auto place = [this](int image) {
      return std::make_pair(segments_.segment_of[image],
                            segments_.rank_of[image]);
    };
    if (place(i) > place(j)) return {j, i, pairs_[e].Inverse()};
    return {i, j, pairs_[e]};
  }

  std::pair<bool, int> Quality(int e) const {
    return {pairs_[e].translation == PairMotion::Translation::kFull,
            graph_.edges[e].num_inliers};
  }

  // Returns how many pairs of the cluster went from one state to another.
  int Change(const ClosureCluster& cluster, EdgeRemoval from, EdgeRemoval to) {
    int num_changed = 0;
    for (const int e : cluster.edges) {
      if (removals_[e] != from) continue;
      removals_[e] = to;
      ++num_changed;
    }
    return num_changed;
  }

  // Rule 2.
  void Vote(const ClosureCluster& cluster) {
    ++report_.num_clusters;
    if (2 * cluster.num_kept > static_cast<int>(cluster.edges.size())) {
      Change(cluster, EdgeRemoval::kOdometry, EdgeRemoval::kOdometryPose);
      return;
    }
    ++report_.num_false_clusters;
    report_.num_pairs_of_false_clusters +=
        Change(cluster, EdgeRemoval::kKept, EdgeRemoval::kFalseLoop);
  }

  // Rule 3.
  void FilterBetween(const std::pair<int, int>& segments,
                     std::vector<ClosureCluster> clusters) {
    clusters.erase(std::remove_if(clusters.begin(), clusters.end(),
                                  [](const ClosureCluster& cluster) {
                                    return cluster.num_kept == 0;
                                  }),
                   clusters.end());
    if (clusters.empty()) return;
    std::stable_sort(clusters.begin(), clusters.end(),
                     [](const ClosureCluster& a, const ClosureCluster& b) {
                       return a.num_kept > b.num_kept;
                     });
    std::vector<int> set = FindSet(segments, clusters);
    // Two drives that are at two places at the same time need no turn: streets
    // that look alike would have to be driven in step.
    const bool are_together = HasTwoPlaces(
        clusters, set, [this](const Closure& one, const Closure& other) {
          return IsAtOneTime(one) && IsAtOneTime(other);
        });
    const bool have_turn = HasTwoPlaces(
        clusters, set, [this](const Closure& one, const Closure& other) {
          return HasTurn(one.i, other.i) && HasTurn(one.j, other.j);
        });
    if (are_together || have_turn) {
      ++report_.num_confirmed_closures;
      if (!are_together && UnitLogSigma(segments) > 0.0) {
        std::vector<ClosureCluster> confirmed;
        for (const int c : set) confirmed.push_back(clusters[c]);
        report_.closures_by_vision.push_back(Describe(segments, confirmed));
      }
    } else {
      set.clear();
      report_.unconfirmed_closures.push_back(Describe(segments, clusters));
    }
    if (!options_.split_unconfirmed_closures) return;
    for (size_t c = 0; c < clusters.size(); ++c) {
      const bool is_confirmed = std::binary_search(set.begin(), set.end(), c);
      for (const int e : clusters[c].edges) {
        if (removals_[e] != EdgeRemoval::kKept ||
            (is_confirmed && AreConsistent(clusters[c].best, MakeClosure(e),
                                           UnitLogSigma(segments)))) {
          continue;
        }
        removals_[e] = EdgeRemoval::kUnconfirmedClosure;
        ++report_.num_pairs_of_unconfirmed_closures;
      }
    }
  }

  // 1 sigma of the log ratio of both segments' units.
  double UnitLogSigma(const std::pair<int, int>& segments) const {
    return segments_.is_metric[segments.first] &&
                   segments_.is_metric[segments.second]
               ? 0.0
               : kUnitLogSigma;
  }

  // All clusters where they are not to be split, such as photos in any order,
  // which have no odometry to test them.
  std::vector<int> FindSet(const std::pair<int, int>& segments,
                           const std::vector<ClosureCluster>& clusters) const {
    const size_t size = std::min(clusters.size(), kMaxNumClusters);
    if (!options_.split_unconfirmed_closures) {
      std::vector<int> all(clusters.size());
      std::iota(all.begin(), all.end(), 0);
      return all;
    }
    ConsistencyMatrix is_consistent(size, std::vector<bool>(size, true));
    std::vector<int> weights;
    for (size_t a = 0; a < size; ++a) {
      weights.push_back(clusters[a].num_kept);
      for (size_t b = a + 1; b < size; ++b) {
        is_consistent[a][b] = is_consistent[b][a] = AreConsistent(
            clusters[a].best, clusters[b].best, UnitLogSigma(segments));
      }
    }
    return FindConsistentSet(is_consistent, weights);
  }

  // Chi-square test of the cycle through both closures and the odometry at both
  // of their ends.
  bool AreConsistent(const Closure& a, const Closure& b,
                     double unit_log_sigma) const {
    const auto image = [this](int index) { return graph_.images[index]; };
    const OdometryChain& chain = odometry_.chain;
    if (!chain.IsConnected(image(a.i), image(b.i)) ||
        !chain.IsConnected(image(a.j), image(b.j))) {
      return false;
    }
    const ChainMotion first = chain.Motion(image(b.i), image(a.i));
    const ChainMotion second = chain.Motion(image(a.j), image(b.j));
    if (!first.has_rotation || !second.has_rotation) return false;
    UncertainMotion predicted =
        UncertainMotion{second.cam2_from_cam1, second.covariance} *
        a.j_from_i.motion *
        UncertainMotion{first.cam2_from_cam1, first.covariance};
    const Eigen::Vector3d by_unit =
        unit_log_sigma * second.cam2_from_cam1.translation;
    predicted.covariance.bottomRightCorner<3, 3>() +=
        by_unit * by_unit.transpose();
    const bool has_position =
        first.has_position && second.has_position &&
        a.j_from_i.translation == PairMotion::Translation::kFull;
    return TestPair(b.j_from_i, predicted, has_position).Probability() >=
           options_.significance;
  }

  // Whether the set has two places that are apart in both segments, and with
  // confirm(place, place).
  template <typename Confirm>
  bool HasTwoPlaces(const std::vector<ClosureCluster>& clusters,
                    const std::vector<int>& set, const Confirm& confirm) const {
    for (const int a : set) {
      for (const int b : set) {
        const Closure& one = clusters[a].best;
        const Closure& other = clusters[b].best;
        if (AreApart(one.i, other.i) && AreApart(one.j, other.j) &&
            confirm(one, other)) {
          return true;
        }
      }
    }
    return false;
  }

  bool AreApart(int i, int j) const {
    return std::abs(segments_.rank_of[i] - segments_.rank_of[j]) >
           options_.max_sequence_gap;
  }

  bool HasTurn(int i, int j) const {
    return segments_.heading_of[i] != segments_.heading_of[j];
  }

  bool IsAtOneTime(const Closure& closure) const {
    return graph_.PositionGap(closure.i, closure.j) <=
           options_.max_sequence_gap;
  }

  SegmentClosure Describe(const std::pair<int, int>& segments,
                          const std::vector<ClosureCluster>& clusters) const {
    SegmentClosure closure;
    closure.num_images = std::min(segments_.num_images[segments.first],
                                  segments_.num_images[segments.second]);
    int max_num_inliers = -1;
    for (const ClosureCluster& cluster : clusters) {
      closure.num_pairs += cluster.num_kept;
      const ViewGraphEdge& edge = graph_.edges[cluster.best_edge];
      if (edge.num_inliers <= max_num_inliers) continue;
      max_num_inliers = edge.num_inliers;
      closure.image_id1 = edge.image_id1;
      closure.image_id2 = edge.image_id2;
    }
    return closure;
  }

  const LoopClosureOptions& options_;
  const TrajectoryOdometry& odometry_;
  ViewGraph& graph_;
  TrajectorySegments segments_;
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
      .AtLeast(1, "max_sequence_gap", max_sequence_gap)
      .AllHold();
}

LoopClosureReport FilterLoopClosures(const LoopClosureOptions& options,
                                     const TrajectoryOdometry& odometry,
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
