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
  // Images at most this far apart in the order of capture follow each other;
  // pairs of others are loop closures. It also sets the windows of clusters:
  // twice this and one within a segment, this and one between segments.
  int max_sequence_gap = 10;
  // Segments that only loop closures join stay models of their own unless the
  // closures confirm each other. Off: they are joined, and reported.
  bool split_unconfirmed_closures = true;

  bool IsValid(std::string* error) const;
};

}  // namespace adasfm
