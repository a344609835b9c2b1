// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/covisibility.h"

namespace adasfm {

// How the reduced camera system of an adjustment is solved, by the size of its
// Cholesky factor.
struct FactorPlan {
  // Whether the factor is no larger than that of max_num_images_sparse images
  // that all see each other. Drives are nearly banded and stay far below.
  bool is_small = true;
  // Images that share fewer points count as sharing none: 1, or more where the
  // factor is large or memory short (docs/reference/math.md).
  int min_num_shared_points = 1;
  // The pairs that share enough points and are not redundant, by which tracks
  // are cut; only where min_num_shared_points is above 1.
  std::optional<Covisibility> cut;
};

// Whether motions that sensors measured, with their lengths, tie all images but
// one in a hundred.
bool DoSensorsTieImages(const std::vector<PosePriorEdge>& priors,
                        const std::set<image_t>& images);

// max_memory_gb: of the process, in GB (1e9 bytes); negative: no limit.
FactorPlan PlanFactor(const PriorBundleAdjustmentProblem& problem,
                      const colmap::Reconstruction& reconstruction,
                      int max_num_images_sparse, double max_memory_gb);

}  // namespace adasfm
