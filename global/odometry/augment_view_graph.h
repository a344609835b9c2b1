// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct AugmentationOptions {
  // Off: the graph is purely visual, and stays split where vision has no edge.
  bool enabled = true;
  // eps_T: priors over longer times are used only if their covariance is small
  // (IsKnownMotion).
  double max_prior_time_gap_s = 0.5;
  // Keep lengths in metres; otherwise unit vectors, as the paper does.
  bool use_metric_lengths = true;

  bool IsValid(std::string* error) const;
};

// Whether a prior may be used. eps_T stands for the error that grows with time.
// A prior over a longer time, of a machine that takes a photo a second, must
// have a small covariance (1 sigma): at most a degree for each axis of the
// rotation and, where there is a translation, the larger of 5 cm and a
// twentieth of its length.
bool IsKnownMotion(const AugmentationOptions& options,
                   const RelativePosePrior& prior);

// Before rotation averaging: adds the priors with a rotation as edges where the
// graph has no kept edge. Returns how many.
int AddSensorEdges(const AugmentationOptions& options,
                   const std::vector<RelativePosePrior>& priors,
                   ViewGraph* graph);

// Before translation averaging: translations of consecutive images come from
// the priors (step 2.5), rotations stay. Returns how many edges.
int AugmentTranslations(const AugmentationOptions& options,
                        const std::vector<RelativePosePrior>& priors,
                        ViewGraph* graph);

}  // namespace adasfm
