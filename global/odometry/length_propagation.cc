// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/length_propagation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "core/median.h"
#include "core/parallel.h"
#include "core/so3.h"
#include "global/view_graph/epipolar.h"
#include "global/view_graph/tracks.h"

namespace adasfm {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Matches whose rays enclose a smaller angle hardly constrain depth, and are
// used only as far as a pair has fewer good ones than kMinMatchRatio of all.
// The few matches of a short step with wide parallax are wrong ones; so matches
// weigh no more than that share of them does.
constexpr double kGoodParallaxRad = DegToRad(1.0);
constexpr double kMinMatchRatio = 0.25;
// Below this it is noise.
constexpr double kMinParallaxRad = DegToRad(0.25);
// Lengths less certain than this (1 sigma of their logarithm) are rejected.
constexpr double kMaxLogSigma = 0.2;
// Their observations are in memory twice.
constexpr size_t kNumEdgesAtATime = 1000;

// Upper bound.
size_t CountObservations(int max_num_matches, const ViewGraph& graph,
                         const GlobalCorrespondences& correspondences) {
  size_t count = 0;
  for (const ViewGraphEdge& edge : graph.edges) {
    const auto matches = correspondences.matches.find(edge.Pair());
    if (!edge.IsKept() || matches == correspondences.matches.end()) continue;
    count += 2 * std::min<size_t>(max_num_matches, matches->second.size());
  }
  return count;
}

}  // namespace

LengthPropagation::LengthPropagation(
    int max_num_matches, int num_threads, const ViewGraph& graph,
    const GlobalCorrespondences& correspondences)
    : max_num_matches_(max_num_matches),
      num_threads_(num_threads),
      graph_(graph) {
  keypoint_begin_.assign(graph.images.size() + 1, 0);
  for (size_t i = 0; i < graph.images.size(); ++i) {
    const auto it = correspondences.bearings.find(graph.images[i]);
    keypoint_begin_[i + 1] =
        keypoint_begin_[i] +
        (it == correspondences.bearings.end() ? 0 : it->second.size());
  }
  JoinKeypointsOfOnePlace(correspondences);
  const size_t num_edges = graph.edges.size();
  edge_begin_.assign(num_edges + 1, 0);
  observations_.reserve(
      CountObservations(max_num_matches, graph, correspondences));
  std::vector<std::vector<Observation>> by_edge(kNumEdgesAtATime);
  for (size_t begin = 0; begin < num_edges; begin += kNumEdgesAtATime) {
    const size_t count = std::min(kNumEdgesAtATime, num_edges - begin);
    ParallelFor(num_threads, count, [&](size_t i) {
      by_edge[i] = ObserveEdge(graph.edges[begin + i], correspondences);
    });
    for (size_t i = 0; i < count; ++i) {
      observations_.insert(observations_.end(), by_edge[i].begin(),
                           by_edge[i].end());
      edge_begin_[begin + i + 1] = observations_.size();
    }
  }
  LinkKeypoints(keypoint_begin_.back());
  log_lengths_.assign(num_edges, 0.0);
  log_sigmas_.assign(num_edges, 0.0);
  is_known_.assign(num_edges, false);
  is_fixed_.assign(num_edges, false);
  has_known_.assign(graph.images.size(), false);
}

// Where vision cannot tell two centres apart, a point has one depth in both
// images. So depths pass through a standstill, however many images it has.
// Wrong matches of so many images would join all points if they were not tested
// (BuildTracks).
void LengthPropagation::JoinKeypointsOfOnePlace(
    const GlobalCorrespondences& correspondences) {
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  for (const ViewGraphEdge& edge : graph_.edges) {
    const auto found = correspondences.matches.find(edge.Pair());
    if (edge.IsAtOnePlace() && found != correspondences.matches.end()) {
      matches.insert(*found);
    }
  }
  if (matches.empty()) return;
  point_of_.resize(keypoint_begin_.back());
  std::iota(point_of_.begin(), point_of_.end(), 0);
  const auto number = [this](const TrackElement& element) {
    return keypoint_begin_[graph_.IndexOf(element.image_id)] +
           static_cast<int>(element.point2D_idx);
  };
  for (const Track& track : BuildTracks(matches)) {
    for (const TrackElement& element : track) {
      point_of_[number(element)] = number(track.front());
    }
  }
}

std::vector<LengthPropagation::Observation> LengthPropagation::ObserveEdge(
    const ViewGraphEdge& edge,
    const GlobalCorrespondences& correspondences) const {
  // Beyond this parallax other errors than the keypoints' decide; without the
  // bound, one wrong match of wide parallax would outweigh a hundred true ones.
  constexpr double kSaturation = 0.05;
  const auto matches = correspondences.matches.find(edge.Pair());
  if (!edge.IsKept() || !edge.has_rotation || !edge.has_translation ||
      !edge.has_baseline || edge.source == EdgeSource::kSensor ||
      matches == correspondences.matches.end()) {
    return {};
  }
  const auto& bearings1 = correspondences.bearings.at(edge.image_id1);
  const auto& bearings2 = correspondences.bearings.at(edge.image_id2);
  const int index1 = graph_.IndexOf(edge.image_id1);
  const int index2 = graph_.IndexOf(edge.image_id2);
  const Eigen::Matrix3d rotation =
      edge.cam2_from_cam1.rotation.toRotationMatrix();
  const Eigen::Vector3d translation =
      edge.cam2_from_cam1.translation.normalized();
  const double min_sin_parallax = std::sin(kMinParallaxRad);
  const double good_sin_parallax = std::sin(kGoodParallaxRad);
  int num_good = 0;
  using Candidate = std::pair<Observation, Observation>;
  std::vector<Candidate> candidates;
  for (const FeatureMatch& match : matches->second) {
    double depth1, depth2, sin_parallax;
    if (!ComputeRayDepths(bearings1.at(match.point2D_idx1).direction,
                          bearings2.at(match.point2D_idx2).direction, rotation,
                          translation, &depth1, &depth2, &sin_parallax)) {
      continue;
    }
    if (depth1 <= 0.0 || depth2 <= 0.0 || sin_parallax < min_sin_parallax) {
      continue;
    }
    num_good += sin_parallax >= good_sin_parallax;
    const double squared = sin_parallax * sin_parallax;
    const float weight = squared / (squared + kSaturation * kSaturation);
    candidates.push_back(
        {{PointOf(index1, match.point2D_idx1), float(std::log(depth1)), weight},
         {PointOf(index2, match.point2D_idx2), float(std::log(depth2)),
          weight}});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) {
                     return a.first.weight > b.first.weight;
                   });
  const int num_required =
      static_cast<int>(std::ceil(kMinMatchRatio * matches->second.size()));
  if (static_cast<int>(candidates.size()) < std::max(1, num_required)) {
    return {};
  }
  const float max_weight = candidates[num_required - 1].first.weight;
  candidates.resize(
      std::min(std::max(num_good, num_required), max_num_matches_));
  std::vector<Observation> observations;
  observations.reserve(2 * candidates.size());
  for (Candidate& candidate : candidates) {
    for (Observation* observation : {&candidate.first, &candidate.second}) {
      observation->weight = std::min(observation->weight, max_weight);
      observations.push_back(*observation);
    }
  }
  return observations;
}

void LengthPropagation::LinkKeypoints(int num_keypoints) {
  link_begin_.assign(num_keypoints + 1, 0);
  for (const Observation& observation : observations_) {
    ++link_begin_[observation.keypoint + 1];
  }
  for (int k = 0; k < num_keypoints; ++k) link_begin_[k + 1] += link_begin_[k];
  links_.resize(observations_.size());
  std::vector<size_t> next(link_begin_.begin(), link_begin_.end() - 1);
  for (int e = 0; e + 1 < static_cast<int>(edge_begin_.size()); ++e) {
    for (size_t o = edge_begin_[e]; o < edge_begin_[e + 1]; ++o) {
      links_[next[observations_[o].keypoint]++] = {static_cast<int>(o), e};
    }
  }
  num_known_.assign(num_keypoints, 0);
  num_known_at_depth_.assign(num_keypoints, 0);
  log_depths_.assign(num_keypoints, 0.0);
  predicted_.assign(observations_.size(), kInfinity);
}

int LengthPropagation::NumKnownDepths(
    int edge, const GlobalCorrespondences& correspondences) const {
  const ViewGraphEdge& own = graph_.edges[edge];
  const auto matches = correspondences.matches.find(own.Pair());
  if (matches == correspondences.matches.end()) return 0;
  const int index1 = graph_.IndexOf(own.image_id1);
  return static_cast<int>(std::count_if(
      matches->second.begin(), matches->second.end(),
      [&](const FeatureMatch& match) {
        return num_known_[PointOf(index1, match.point2D_idx1)] > 0;
      }));
}

void LengthPropagation::MarkKnown(int edge) {
  if (is_known_[edge]) return;
  is_known_[edge] = true;
  has_known_[graph_.IndexOf(graph_.edges[edge].image_id1)] = true;
  has_known_[graph_.IndexOf(graph_.edges[edge].image_id2)] = true;
  for (size_t o = edge_begin_[edge]; o < edge_begin_[edge + 1]; ++o) {
    ++num_known_[observations_[o].keypoint];
  }
}

void LengthPropagation::Fix(int edge, double log_length, double log_sigma) {
  log_lengths_[edge] = log_length;
  log_sigmas_[edge] = log_sigma;
  is_fixed_[edge] = true;
  MarkKnown(edge);
}

void LengthPropagation::Start(int edge, const EdgeLength& length) {
  if (is_known_[edge] || edge_begin_[edge] == edge_begin_[edge + 1]) return;
  log_lengths_[edge] = std::log(length.length);
  log_sigmas_[edge] = length.log_sigma;
  MarkKnown(edge);
}

void LengthPropagation::Seed(int edge) {
  std::vector<WeightedValue> log_depths;
  for (size_t o = edge_begin_[edge]; o < edge_begin_[edge + 1]; o += 2) {
    log_depths.push_back({observations_[o].offset, 1.0});
  }
  Fix(edge, SeedDepth() - WeightedMedian(&log_depths), kMaxLogSigma);
}

double LengthPropagation::SeedDepth() {
  if (!seed_log_depth_.has_value()) {
    std::vector<WeightedValue> log_depths;
    for (size_t e = 0; e < graph_.edges.size(); ++e) {
      if (!is_known_[e]) continue;
      for (size_t o = edge_begin_[e]; o < edge_begin_[e + 1]; ++o) {
        log_depths.push_back({log_lengths_[e] + observations_[o].offset, 1.0});
      }
    }
    seed_log_depth_ = log_depths.empty() ? 0.0 : WeightedMedian(&log_depths);
  }
  return *seed_log_depth_;
}

bool LengthPropagation::TouchesKnown(int edge) const {
  return has_known_[graph_.IndexOf(graph_.edges[edge].image_id1)] ||
         has_known_[graph_.IndexOf(graph_.edges[edge].image_id2)];
}

EdgeLength LengthPropagation::Get(int edge) const {
  return {std::exp(log_lengths_[edge]), log_sigmas_[edge]};
}

void LengthPropagation::Sweep() {
  ParallelFor(num_threads_, num_known_.size(),
              [this](size_t keypoint) { PredictDepths(keypoint); });
  ParallelFor(num_threads_, graph_.edges.size(), [this](size_t e) {
    if (!is_known_[e] || is_fixed_[e]) return;
    std::vector<WeightedValue> values;
    for (size_t o = edge_begin_[e]; o < edge_begin_[e + 1]; ++o) {
      if (!std::isfinite(predicted_[o])) continue;
      values.push_back(
          {predicted_[o] - observations_[o].offset, observations_[o].weight});
    }
    EdgeLength learned;
    if (!LearnLength(&values, &learned)) return;
    log_lengths_[e] = learned.length;
    log_sigmas_[e] = learned.log_sigma;
  });
}

// For each edge the median depth by the other edges, from one sorted list.
void LengthPropagation::PredictDepths(int keypoint) {
  struct Entry {
    double value;
    double weight;
    int observation;
  };
  std::vector<Entry> entries;
  double sum = 0.0;
  for (size_t k = link_begin_[keypoint]; k < link_begin_[keypoint + 1]; ++k) {
    const Link& link = links_[k];
    predicted_[link.observation] = kInfinity;
    if (!is_known_[link.edge]) continue;
    const Observation& observation = observations_[link.observation];
    entries.push_back({log_lengths_[link.edge] + observation.offset,
                       observation.weight, link.observation});
    sum += observation.weight;
  }
  if (entries.size() < 2) return;
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.value < b.value; });
  for (const Entry& own : entries) {
    double half = 0.5 * (sum - own.weight);
    for (const Entry& entry : entries) {
      if (entry.observation == own.observation) continue;
      predicted_[own.observation] = entry.value;
      half -= entry.weight;
      if (half <= 0.0) break;
    }
  }
}

// The logarithm of a length and its sigma; false if too uncertain.
bool LengthPropagation::LearnLength(std::vector<WeightedValue>* values,
                                    EdgeLength* log_length) const {
  if (static_cast<int>(values->size()) < kMinNumShared) return false;
  log_length->length = WeightedMedian(values);
  for (WeightedValue& value : *values) {
    value.value = std::abs(value.value - log_length->length);
  }
  // 1.4826 takes a median deviation to a normal's sigma, sqrt(pi / 2) the
  // mean's error to the median's.
  log_length->log_sigma = 1.4826 * 1.2533 * WeightedMedian(values) /
                          std::sqrt(static_cast<double>(values->size()));
  return log_length->log_sigma <= kMaxLogSigma;
}

}  // namespace adasfm
