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
  LengthPropagation(const EdgeLengthOptions& options, const ViewGraph& graph,
                    const GlobalCorrespondences& correspondences);

  // A length that stays.
  void Fix(int edge, double log_length, double log_sigma);
  // A length to start from.
  void Start(int edge, const EdgeLength& length);
  // Fixes a length at which the edge's points have the same median depth as
  // those of all seeds, and of the edges that were known before.
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
  // Learns all known lengths anew from each other, all at once.
  void Sweep();
  // By edge: lengths of one number have one unit, fixed ones the same. An edge
  // whose length nothing tells has a unit of its own; -1 without parallax.
  std::vector<int> FindUnits() const;

 private:
  // What an edge sees of a keypoint: log depth = log length(edge) + offset.
  // There are hundreds for each edge, so they are kept small.
  struct Observation {
    int keypoint = 0;
    int edge = 0;
    float offset = 0.0f;
    float weight = 0.0f;
  };
  // Of the units that an edge shares enough keypoints with, those whose size
  // against its own these tell.
  std::vector<int> FindUnitsOfKnownSize(int edge, DisjointSets* sets) const;
  std::vector<Observation> ObserveEdge(
      const ViewGraphEdge& edge,
      const GlobalCorrespondences& correspondences) const;
  void LinkKeypoints(int num_keypoints);
  void MarkKnown(int edge);
  double SeedDepth();
  double StartingDepth(int keypoint);
  bool LearnFromStart(int edge);
  void PredictDepths(int keypoint);
  bool LearnLength(std::vector<WeightedValue>* values,
                   EdgeLength* log_length) const;

  const EdgeLengthOptions& options_;
  const ViewGraph& graph_;
  std::vector<int> keypoint_begin_;  // by image
  // By edge; those of one edge follow each other.
  std::vector<Observation> observations_;
  std::vector<size_t> edge_begin_;
  // Observations by keypoint.
  std::vector<int> links_;
  std::vector<size_t> link_begin_;

  std::vector<double> log_lengths_;
  std::vector<double> log_sigmas_;
  std::vector<char> is_known_;
  std::vector<char> is_fixed_;
  std::vector<char> has_known_;  // by image
  // The logarithm of a seed's median depth; found with the first one.
  std::optional<double> seed_log_depth_;
  // By keypoint: known edges, and the depth with the number it was found from.
  std::vector<int> num_known_;
  std::vector<int> num_known_at_depth_;
  std::vector<double> log_depths_;
  // By observation: the keypoint's log depth by its other edges; infinite where
  // there are none.
  std::vector<float> predicted_;
};

}  // namespace adasfm
