// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "core/disjoint_sets.h"
#include "global/loop_closures/pair_motion.h"
#include "global/loop_closures/trajectory_segments.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/uncertain_motion.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// A pair from image i to image j, indices of ViewGraph::images.
struct Closure {
  int i = 0;
  int j = 0;
  PairMotion j_from_i;

  Closure Inverse() const { return {j, i, j_from_i.Inverse()}; }
};

// Trajectory segments that confirmed closures join: a tree of segments, along
// which the motion between any two images is known.
class SegmentGroups {
 public:
  struct Motion {
    UncertainMotion j_from_i;
    bool has_position = false;
  };

  // All references must outlive the groups.
  SegmentGroups(const TrajectorySegments& segments, const OdometryChain& chain,
                const ViewGraph& graph);

  // The group of an image: the index of one image of it.
  int GroupOf(int image) const;
  bool IsMetric(int group) const { return is_metric_[group]; }
  int NumImages(int group) const { return num_images_[group]; }
  // Joins the groups of both images.
  void Join(const Closure& closure);
  // Between images of one group; none where a rotation is missing on the way.
  std::optional<Motion> FindMotion(int i, int j) const;
  // Whether images of one group are two places beyond a turn.
  bool AreApart(int i, int j, int max_sequence_gap) const;

 private:
  // Along the odometry of one segment.
  std::optional<Motion> MotionInSegment(int i, int j) const;

  const TrajectorySegments& segments_;
  const OdometryChain& chain_;
  const ViewGraph& graph_;
  mutable DisjointSets groups_;
  std::vector<bool> is_metric_;
  std::vector<int> num_images_;
  // From each segment.
  std::map<int, std::vector<Closure>> closures_;
};

}  // namespace adasfm
