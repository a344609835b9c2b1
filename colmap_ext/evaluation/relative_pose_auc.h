// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/rigid3d.h"

namespace adasfm {

// Area under the curve of recall over error from 0 to the threshold, in
// percent, as in the paper's Table I.
struct RelativePoseAuc {
  double threshold_deg = 0.0;
  double rotation_percent = 0.0;
  double translation_percent = 0.0;  // of the direction
};

// Accumulates errors of pairs at the paper's thresholds.
class RelativePoseAucCounter {
 public:
  // Only the directions of translations are compared; pairs without a true
  // baseline have no direction error.
  void Add(const Rigid3d& cam2_from_cam1, const Rigid3d& true_cam2_from_cam1);
  // One entry per threshold, ascending; zeros without pairs.
  std::vector<RelativePoseAuc> Result() const;

 private:
  static constexpr std::array<double, 7> kThresholdsDeg = {0.1, 0.5,  1.0, 3.0,
                                                           5.0, 10.0, 20.0};
  struct Sums {
    void Add(double error_deg);
    double Percent(size_t k) const;

    int64_t count = 0;
    std::array<double, kThresholdsDeg.size()> areas = {};
  };

  Sums rotations_;
  Sums directions_;
};

}  // namespace adasfm
