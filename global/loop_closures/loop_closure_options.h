// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace adasfm {

// What decides whether an image pair is a false loop closure
// (docs/reference/math.md, Loop closures).
struct LoopClosureOptions {
  bool enabled = true;
  // Level of the chi-square tests: true pairs have a larger value with this
  // probability.
  double significance = 1e-5;
  // 1 sigma of the errors added to those of a pair's own pose: of its rotation
  // and direction, and of the logarithm of its length.
  double pair_angle_sigma_deg = 0.5;
  double pair_length_log_sigma = 0.03;
  // 1 sigma of the log ratio of two segments' units, unless sensors give both
  // metres: the scene is as deep there as elsewhere, within a factor of two.
  double unit_log_sigma = 0.35;
  // Images at most this far apart in the order of capture follow each other;
  // pairs of others are loop closures. It also sets the windows of clusters:
  // twice this and one within a segment, this and one between segments.
  int max_sequence_gap = 10;
  // Segments that only loop closures join stay models of their own unless the
  // closures confirm each other. Off: they are joined, and reported.
  bool split_unconfirmed_closures = true;
  // Two closures between segments confirm each other only if the heading
  // changes by this much between them: a long straight street can look alike
  // all along.
  double min_turn_deg = 30.0;

  bool IsValid(std::string* error) const;
};

}  // namespace adasfm
