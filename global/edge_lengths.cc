// SPDX-License-Identifier: BSD-3-Clause
#include "global/edge_lengths.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <tuple>

#include "core/parallel.h"
#include "core/so3.h"
#include "global/epipolar.h"

namespace adasfm {
namespace {

struct WeightedValue {
  double value = 0.0;
  double weight = 0.0;
};

double WeightedMedian(std::vector<WeightedValue>* values) {
  std::sort(values->begin(), values->end(),
            [](const WeightedValue& a, const WeightedValue& b) {
              return a.value < b.value;
            });
  double half = 0.0;
  for (const WeightedValue& value : *values) half += 0.5 * value.weight;
  for (const WeightedValue& value : *values) {
    half -= value.weight;
    if (half <= 0.0) return value.value;
  }
  return values->back().value;
}

// A match as depths in units of the edge's length.
struct DepthPair {
  point2D_t index1 = 0;
  point2D_t index2 = 0;
  double log_depth1 = 0.0;
  double log_depth2 = 0.0;
  // Inverse variance of a log depth, up to a factor: the squared parallax.
  double weight = 0.0;
};

// One depth measurement of a keypoint: log depth = log length(edge) + offset.
struct DepthLink {
  int edge = 0;
  double offset = 0.0;
  double weight = 0.0;
};

std::vector<DepthPair> ComputeDepthPairs(
    const EdgeLengthOptions& options, const ViewGraphEdge& edge,
    const std::vector<Bearing>& bearings1,
    const std::vector<Bearing>& bearings2,
    const std::vector<FeatureMatch>& matches) {
  const Eigen::Matrix3d rotation =
      edge.cam2_from_cam1.rotation.toRotationMatrix();
  const Eigen::Vector3d translation =
      edge.cam2_from_cam1.translation.normalized();
  const double min_sin_parallax = std::sin(DegToRad(options.min_parallax_deg));
  // Beyond this parallax other errors than the keypoints' decide; without the
  // bound, one wrong match of wide parallax would outweigh a hundred true ones.
  constexpr double kSaturation = 0.05;
  std::vector<std::pair<double, DepthPair>> candidates;
  for (const FeatureMatch& match : matches) {
    double depth1, depth2, sin_parallax;
    if (!ComputeRayDepths(bearings1.at(match.point2D_idx1).direction,
                          bearings2.at(match.point2D_idx2).direction, rotation,
                          translation, &depth1, &depth2, &sin_parallax)) {
      continue;
    }
    if (depth1 <= 0.0 || depth2 <= 0.0 || sin_parallax < min_sin_parallax) {
      continue;
    }
    const double squared = sin_parallax * sin_parallax;
    candidates.push_back(
        {-sin_parallax,
         {match.point2D_idx1, match.point2D_idx2, std::log(depth1),
          std::log(depth2), squared / (squared + kSaturation * kSaturation)}});
  }
  std::stable_sort(
      candidates.begin(), candidates.end(),
      [](const auto& a, const auto& b) { return a.first < b.first; });
  if (candidates.size() > options.max_num_matches) {
    candidates.resize(options.max_num_matches);
  }
  std::vector<DepthPair> pairs;
  pairs.reserve(candidates.size());
  for (const auto& candidate : candidates) pairs.push_back(candidate.second);
  return pairs;
}

// Alternates between the log depths of keypoints (medians over their edges of
// known length) and the log lengths of edges (medians over their keypoints of
// known depth).
class LengthPropagator {
 public:
  LengthPropagator(const EdgeLengthOptions& options, const ViewGraph& graph,
                   const GlobalCorrespondences& correspondences)
      : options_(options), graph_(graph) {
    keypoint_begin_.assign(graph.images.size() + 1, 0);
    for (size_t i = 0; i < graph.images.size(); ++i) {
      const auto it = correspondences.bearings.find(graph.images[i]);
      keypoint_begin_[i + 1] =
          keypoint_begin_[i] +
          (it == correspondences.bearings.end() ? 0 : it->second.size());
    }
    const size_t num_edges = graph.edges.size();
    depth_pairs_.resize(num_edges);
    ParallelFor(options.num_threads, num_edges, [&](size_t e) {
      const ViewGraphEdge& edge = graph.edges[e];
      const auto it = correspondences.matches.find(edge.Pair());
      if (!edge.IsKept() || !edge.has_rotation || !edge.has_translation ||
          edge.source == EdgeSource::kSensor ||
          it == correspondences.matches.end()) {
        return;
      }
      depth_pairs_[e] = ComputeDepthPairs(
          options, edge, correspondences.bearings.at(edge.image_id1),
          correspondences.bearings.at(edge.image_id2), it->second);
    });
    links_.resize(keypoint_begin_.back());
    for (size_t e = 0; e < num_edges; ++e) {
      for (const DepthPair& pair : depth_pairs_[e]) {
        links_[Keypoint1(e, pair)].push_back(
            {int(e), pair.log_depth1, pair.weight});
        links_[Keypoint2(e, pair)].push_back(
            {int(e), pair.log_depth2, pair.weight});
      }
    }
    log_lengths_.assign(num_edges, 0.0);
    log_sigmas_.assign(num_edges, 0.0);
    is_known_.assign(num_edges, false);
    is_fixed_.assign(num_edges, false);
    has_known_.assign(graph.images.size(), false);
  }

  void Fix(size_t e, double log_length, double log_sigma) {
    log_lengths_[e] = log_length;
    log_sigmas_[e] = log_sigma;
    is_fixed_[e] = true;
    MarkKnown(e);
  }
  // A length at which the edge's points have the same median depth as those of
  // all seeds.
  void Seed(size_t e) {
    std::vector<WeightedValue> log_depths;
    for (const DepthPair& pair : depth_pairs_[e]) {
      log_depths.push_back({pair.log_depth1, 1.0});
    }
    Fix(e, -WeightedMedian(&log_depths), options_.max_log_sigma);
  }
  // Whether an edge of known length ends at one of its images.
  bool TouchesKnown(size_t e) const {
    return has_known_[graph_.IndexOf(graph_.edges[e].image_id1)] ||
           has_known_[graph_.IndexOf(graph_.edges[e].image_id2)];
  }
  bool IsKnown(size_t e) const { return is_known_[e]; }
  size_t NumDepthPairs(size_t e) const { return depth_pairs_[e].size(); }

  // Spreads lengths from the known edges to those that share enough keypoints
  // with them, most first.
  void Spread(int min_num_shared) {
    using Candidate = std::tuple<int, int>;  // shared keypoints, -edge
    std::priority_queue<Candidate> queue;
    std::vector<int> num_shared(depth_pairs_.size(), 0);
    std::vector<bool> has_depth(links_.size(), false);
    const auto announce = [&](size_t e) {
      for (const DepthPair& pair : depth_pairs_[e]) {
        for (const size_t keypoint : {Keypoint1(e, pair), Keypoint2(e, pair)}) {
          if (has_depth[keypoint]) continue;
          has_depth[keypoint] = true;
          for (const DepthLink& link : links_[keypoint]) {
            if (is_known_[link.edge]) continue;
            if (++num_shared[link.edge] >= min_num_shared) {
              queue.emplace(num_shared[link.edge], -link.edge);
            }
          }
        }
      }
    };
    for (size_t e = 0; e < depth_pairs_.size(); ++e) {
      if (is_known_[e]) announce(e);
    }
    while (!queue.empty()) {
      const size_t e = -std::get<1>(queue.top());
      queue.pop();
      if (is_known_[e]) continue;
      if (UpdateLength(e)) announce(e);
    }
  }

  void Sweep() {
    for (size_t e = 0; e < depth_pairs_.size(); ++e) {
      if (is_known_[e] && !is_fixed_[e]) UpdateLength(e);
    }
  }

  EdgeLength Get(size_t e) const {
    return {std::exp(log_lengths_[e]), log_sigmas_[e]};
  }

 private:
  void MarkKnown(size_t e) {
    is_known_[e] = true;
    has_known_[graph_.IndexOf(graph_.edges[e].image_id1)] = true;
    has_known_[graph_.IndexOf(graph_.edges[e].image_id2)] = true;
  }

  size_t Keypoint1(size_t e, const DepthPair& pair) const {
    return keypoint_begin_[graph_.IndexOf(graph_.edges[e].image_id1)] +
           pair.index1;
  }
  size_t Keypoint2(size_t e, const DepthPair& pair) const {
    return keypoint_begin_[graph_.IndexOf(graph_.edges[e].image_id2)] +
           pair.index2;
  }

  // The log depth of a keypoint by the other edges of known length.
  bool LogDepth(size_t keypoint, size_t except_edge, double* log_depth) const {
    std::vector<WeightedValue> values;
    for (const DepthLink& link : links_[keypoint]) {
      if (link.edge == except_edge || !is_known_[link.edge]) continue;
      values.push_back({log_lengths_[link.edge] + link.offset, link.weight});
    }
    if (values.empty()) return false;
    *log_depth = WeightedMedian(&values);
    return true;
  }

  bool UpdateLength(size_t e) {
    std::vector<WeightedValue> values;
    for (const DepthPair& pair : depth_pairs_[e]) {
      double log_depth;
      if (LogDepth(Keypoint1(e, pair), e, &log_depth)) {
        values.push_back({log_depth - pair.log_depth1, pair.weight});
      }
      if (LogDepth(Keypoint2(e, pair), e, &log_depth)) {
        values.push_back({log_depth - pair.log_depth2, pair.weight});
      }
    }
    if (values.size() < options_.min_num_shared) return false;
    const double median = WeightedMedian(&values);
    for (WeightedValue& value : values) {
      value.value = std::abs(value.value - median);
    }
    // 1.4826 takes a median deviation to a normal's sigma, sqrt(pi / 2) the
    // mean's error to the median's.
    const double log_sigma = 1.4826 * 1.2533 * WeightedMedian(&values) /
                             std::sqrt(static_cast<double>(values.size()));
    if (!(log_sigma <= options_.max_log_sigma)) return false;
    log_lengths_[e] = median;
    log_sigmas_[e] = log_sigma;
    MarkKnown(e);
    return true;
  }

  const EdgeLengthOptions& options_;
  const ViewGraph& graph_;
  std::vector<size_t> keypoint_begin_;
  std::vector<std::vector<DepthPair>> depth_pairs_;
  std::vector<std::vector<DepthLink>> links_;
  std::vector<double> log_lengths_;
  std::vector<double> log_sigmas_;
  std::vector<bool> is_known_;
  std::vector<bool> is_fixed_;
  std::vector<bool> has_known_;  // by image
};

// Starts every part of the graph that shares too few points with the others,
// the edges with most matches first. Their units are tied by the depth of the
// scene: its median is taken to be the same everywhere.
void SeedParts(const EdgeLengthOptions& options, const ViewGraph& graph,
               LengthPropagator* propagator) {
  std::vector<int> order(graph.edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [propagator](int a, int b) {
    return propagator->NumDepthPairs(a) > propagator->NumDepthPairs(b);
  });
  for (const int e : order) {
    if (propagator->NumDepthPairs(e) < options.num_shared_reliable) break;
    if (propagator->TouchesKnown(e)) continue;
    propagator->Seed(e);
    propagator->Spread(options.num_shared_reliable);
  }
}

}  // namespace

bool EdgeLengthOptions::IsValid(std::string* error) const {
  if (!(min_parallax_deg > 0.0)) {
    *error = "min_parallax_deg = " + std::to_string(min_parallax_deg) +
             " must be > 0";
    return false;
  }
  if (max_num_matches < 1 || min_num_shared < 1 ||
      num_shared_reliable < min_num_shared || num_sweeps < 0 ||
      !(max_log_sigma > 0.0)) {
    *error = "max_num_matches = " + std::to_string(max_num_matches) +
             " and min_num_shared = " + std::to_string(min_num_shared) +
             " must be >= 1, num_shared_reliable >= min_num_shared, "
             "max_log_sigma > 0, num_sweeps = " +
             std::to_string(num_sweeps) + " >= 0";
    return false;
  }
  return true;
}

EdgeLengths EstimateEdgeLengths(
    const EdgeLengthOptions& options, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences) {
  LengthPropagator propagator(options, graph, correspondences);
  EdgeLengths result;
  const size_t num_edges = graph.edges.size();
  for (size_t e = 0; e < num_edges; ++e) {
    const auto it = known_lengths_m.find(graph.edges[e].Pair());
    if (it == known_lengths_m.end() || !(it->second > 0.0)) continue;
    constexpr double kPriorLogSigma = 0.02;
    propagator.Fix(e, std::log(it->second), kPriorLogSigma);
    result.metric = true;
  }
  propagator.Spread(options.num_shared_reliable);
  if (!result.metric) SeedParts(options, graph, &propagator);
  propagator.Spread(options.min_num_shared);
  for (int i = 0; i < options.num_sweeps; ++i) propagator.Sweep();
  result.lengths.resize(num_edges);
  for (size_t e = 0; e < num_edges; ++e) {
    if (propagator.IsKnown(e)) result.lengths[e] = propagator.Get(e);
  }
  return result;
}

}  // namespace adasfm
