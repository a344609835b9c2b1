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

// How far vision and one kind of prior agree: priors between images that points
// hold too, after the adjustment.
struct PriorAgreement {
  std::string kind;  // "rotation" or "translation"
  int num_priors = 0;
  // Median over the priors of the squared whitened residual, divided by that of
  // honest ones: 1 or less when the covariances are right, since the adjustment
  // has drawn the poses to the priors.
  double chi2_ratio = 0.0;
  // The share of priors beyond what one honest prior in 1,000 has.
  double share_contradicting = 0.0;
};

// Squared whitened residuals of priors, by kind.
struct PriorResiduals {
  std::vector<double> rotations;
  std::vector<double> translations;
};

// Adds those of the scene's priors between images of the model that points
// hold; translations are of priors with direction and length [m], without the
// rotation of the direction of driving that all of them share. That is an
// unknown of the adjustment and no contradiction (shared_errors.h), and no more
// is size_over_priors, by which the finished model was made larger.
void AddPriorResiduals(const SceneData& data,
                       const colmap::Reconstruction& model,
                       double size_over_priors, PriorResiduals* residuals);

// One entry for each kind that has residuals.
std::vector<PriorAgreement> SummarizeAgreement(PriorResiduals residuals);

}  // namespace adasfm
