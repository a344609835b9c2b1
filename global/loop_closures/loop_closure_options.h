// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace adasfm {

// What decides whether a pair of images is a false loop
// (docs/reference/math.md, Loop closures).
struct LoopClosureOptions {
  bool enabled = true;
  // A pair contradicts the odometry, and two loops contradict each other, when
  // true ones would have a larger chi-square with this probability only.
  double significance = 1e-5;
  // Least errors granted to a pair's own pose, 1 sigma: its rotation and
  // direction, and the logarithm of its length.
  double pair_angle_sigma_deg = 0.5;
  double pair_length_log_sigma = 0.03;
  // Of the unit of a part that no sensor gives metres, 1 sigma of its
  // logarithm: the scene is as deep there as elsewhere, within a factor of two
  // (2 sigmas).
  double unit_log_sigma = 0.35;
  // Images at most this far apart in the order of capture follow each other.
  // Pairs of such images make the parts of a drive; others are loops, and those
  // that join the same stretches of this length are one place.
  int max_sequence_gap = 10;
  // Parts that only pairs of distant images join: without a second place that
  // confirms it they stay models of their own. Off: they are joined, and
  // reported.
  bool split_unverified_joins = true;
  // Pairs that a place needs to join two parts.
  int min_num_pairs = 3;
  // Two places confirm each other beyond a turn only: a straight street can
  // look alike all along, however long it is.
  double min_turn_deg = 30.0;

  bool IsValid(std::string* error) const;
};

}  // namespace adasfm
