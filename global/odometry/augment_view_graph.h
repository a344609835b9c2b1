// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct AugmentationOptions {
  // Off: the plain visual graph; where vision has no edge it stays split.
  bool enabled = true;
  // eps_T: priors over longer times take part only if they know the motion all
  // the same (IsKnownMotion).
  double max_prior_time_gap_s = 0.5;
  // Keep lengths in metres; otherwise unit vectors, as the paper does.
  bool use_metric_lengths = true;

  bool IsValid(std::string* error) const;
};

// Whether a prior may take part: eps_T stands for the error that grows with
// time. A prior over a longer time, of a machine that takes a photo a second,
// must show that it errs little by its covariance: each rotation by at most a
// degree and, where there is one, the translation by at most a twentieth of its
// length or 5 cm (1 sigma).
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
