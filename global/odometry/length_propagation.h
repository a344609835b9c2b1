// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "core/disjoint_sets.h"
#include "core/median.h"
#include "global/odometry/edge_lengths.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Alternates between the log depths of keypoints (medians over their edges of
// known length) and the log lengths of edges (medians over their keypoints of
// known depth). One match is two observations, one in each image.
class LengthPropagation {
 public:
  // Keypoints with known depth that an edge must share.
  static constexpr int kMinNumShared = 5;

  // max_num_matches: used per edge, those with the largest parallax.
  LengthPropagation(int max_num_matches, int num_threads,
                    const ViewGraph& graph,
                    const GlobalCorrespondences& correspondences);

  // Of a pair without a baseline: how many of its matches see a point whose
  // depth an edge of known length measures.
  int NumKnownDepths(int edge,
                     const GlobalCorrespondences& correspondences) const;

  // Sets a length that stays fixed.
  void Fix(int edge, double log_length, double log_sigma);
  // Sets an initial length.
  void Start(int edge, const EdgeLength& length);
  // Fixes a length at which the edge's points have the same median depth as
  // those of all seeds, and of the edges known before the first seed.
  void Seed(int edge);
  // Whether an edge of known length ends at one of its images.
  bool TouchesKnown(int edge) const;
  bool IsKnown(int edge) const { return is_known_[edge]; }
  int NumMatches(int edge) const {
    return static_cast<int>(edge_begin_[edge + 1] - edge_begin_[edge]) / 2;
  }
  EdgeLength Get(int edge) const;

  // Spreads lengths from the known edges to those that share enough keypoints
  // with them, most first.
  void Spread(int min_num_shared);
  // Re-estimates all known lengths but the fixed ones from each other, all at
  // once.
  void Sweep();
  // Unit by edge: lengths of one number share a unit, as do all fixed lengths.
  // An edge of unknown length has a unit of its own; -1 with too little
  // parallax.
  std::vector<int> FindUnits() const;

 private:
  // Depth of a keypoint in an edge: log depth = log length(edge) + offset.
  // Small, since each edge has hundreds.
  struct Observation {
    int keypoint = 0;
    float offset = 0.0f;
    float weight = 0.0f;
  };
  // An observation of a keypoint, with its edge: Spread() reads the edges of
  // all links, and no observation.
  struct Link {
    int observation = 0;
    int edge = 0;
  };
  // The units whose scale relative to the edge's own is determined by the
  // keypoints that they share with the edge.
  std::vector<int> FindUnitsOfKnownSize(int edge, DisjointSets* sets) const;
  std::vector<Observation> ObserveEdge(
      const ViewGraphEdge& edge,
      const GlobalCorrespondences& correspondences) const;
  void JoinKeypointsOfOnePlace(const GlobalCorrespondences& correspondences);
  int PointOf(int image_index, point2D_t keypoint) const {
    const int own = keypoint_begin_[image_index] + static_cast<int>(keypoint);
    return point_of_.empty() ? own : point_of_[own];
  }
  void LinkKeypoints(int num_keypoints);
  void MarkKnown(int edge);
  double SeedDepth();
  double StartingDepth(int keypoint);
  bool LearnFromStart(int edge);
  void PredictDepths(int keypoint);
  bool LearnLength(std::vector<WeightedValue>* values,
                   EdgeLength* log_length) const;

  const int max_num_matches_;
  const int num_threads_;
  const ViewGraph& graph_;
  std::vector<int> keypoint_begin_;  // by image
  // By keypoint: the one that stands for all that see the same point from the
  // same place; empty where each stands for itself. A keypoint below is one
  // that stands for others.
  std::vector<int> point_of_;
  // By edge; those of one edge follow each other.
  std::vector<Observation> observations_;
  std::vector<size_t> edge_begin_;
  // By keypoint.
  std::vector<Link> links_;
  std::vector<size_t> link_begin_;

  std::vector<double> log_lengths_;
  std::vector<double> log_sigmas_;
  std::vector<char> is_known_;
  std::vector<char> is_fixed_;
  std::vector<char> has_known_;  // by image
  // The logarithm of a seed's median depth; found with the first seed.
  std::optional<double> seed_log_depth_;
  // By keypoint: the number of known edges, that number when the depth was
  // computed, and the depth.
  std::vector<int> num_known_;
  std::vector<int> num_known_at_depth_;
  std::vector<double> log_depths_;
  // By observation: the keypoint's log depth by its other edges; infinite where
  // there are none.
  std::vector<float> predicted_;
};

}  // namespace adasfm
