// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// Whether the image is in the model and sees enough points (15) for a pose of
// its own.
bool IsHeldByPoints(const colmap::Reconstruction& model, image_t image_id);

// Agreement of vision with one kind of prior after the adjustment, over priors
// between images that points constrain, too.
struct PriorAgreement {
  std::string kind;  // "rotation" or "translation"
  int num_priors = 0;
  // Median over the priors of the squared whitened residual, divided by its
  // expected median. 1 or less for correct covariances, since the adjustment
  // has fitted the poses to the priors.
  double chi2_ratio = 0.0;
  // Share of priors with residuals that one correct prior in 1,000 exceeds.
  double share_contradicting = 0.0;
};

// Squared whitened residuals of priors, by kind.
struct PriorResiduals {
  std::vector<double> rotations;
  std::vector<double> translations;
};

// Adds the residuals of the scene's priors between images of the model that
// points constrain. Translations are those of priors with direction and length
// [m]. Three errors are no contradictions and are taken out: what drives share
// of the gyroscope's bias, which walks, and of the direction of driving, both
// unknowns of the adjustment (shared_errors.h), and size_over_priors, by which
// the finished model was enlarged.
void AddPriorResiduals(const SceneData& data,
                       const colmap::Reconstruction& model,
                       double size_over_priors, PriorResiduals* residuals);

// One entry for each kind that has residuals.
std::vector<PriorAgreement> SummarizeAgreement(PriorResiduals residuals);

}  // namespace adasfm
