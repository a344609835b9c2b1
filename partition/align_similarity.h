// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/sim3d.h"

namespace adasfm {

// The poses of one image in two worlds.
struct PosePair {
  Rigid3d cam_from_source;
  Rigid3d cam_from_target;
};

// Alg. 2 of the paper. Thresholds are in units of `unit` (1 m when the target
// is metric, else the median distance between neighbouring images).
struct AlignSimilarityOptions {
  // tau_init, alpha_inc, alpha_dec, r_min, r_max: the paper's values.
  double initial_threshold = 1.0;
  double threshold_increase = 0.2;
  double threshold_decrease = 0.1;
  double min_inlier_ratio = 0.7;
  double max_inlier_ratio = 0.9;
  // Off: tau_init is used as it is (the paper's ablation).
  bool adapt_threshold = true;
  double unit = 1.0;

  bool IsValid(std::string* error) const;
};

struct AlignSimilarityResult {
  // False when fewer than three images are common or the inlier ratio stayed
  // below min_inlier_ratio; the other fields then describe the last attempt.
  bool success = false;
  Sim3d target_from_source;
  // In the target's unit of length.
  double threshold = 0.0;
  double inlier_ratio = 0.0;
  // Of the inliers' centres.
  double rmse = 0.0;
  int num_iterations = 0;
  std::vector<char> inlier_mask;
};

// Lower bound of the thresholds, in units of `unit`.
inline constexpr double kMinAlignmentThreshold = 0.1;

// Aligns a part to the global frame by RANSAC on camera poses. The threshold is
// raised while fewer than r_min of the images are inliers, and lowered while at
// least r_max of them are. Returns the similarity estimated at the final
// threshold, the lowest one tried that still keeps r_min.
AlignSimilarityResult AlignSimilarity(const AlignSimilarityOptions& options,
                                      const std::vector<PosePair>& poses);

// Least squares on centres and orientations of the pairs in the mask:
//   min sum |C_target - (s Q C_source + t)|^2 + weight^2 sum |Q - Q_i|^2,
// with Q_i = R_target^T R_source and the Frobenius norm. `orientation_weight`
// has the target's unit of length: centres whose spread about a line exceeds
// the weight determine the rotation themselves; on a straight road the
// orientations determine the roll. False with fewer than two pairs or
// coinciding centres.
bool EstimatePoseSimilarity(const std::vector<PosePair>& poses,
                            const std::vector<char>& mask,
                            double orientation_weight,
                            Sim3d* target_from_source);

}  // namespace adasfm
