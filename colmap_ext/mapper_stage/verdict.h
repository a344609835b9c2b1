// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/mapper/lens_error.h"
#include "colmap_ext/mapper_stage/lost_images.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/mapper_stage/prior_agreement.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// A verdict on the models of a database, for users who do not know the field
// and for programs.
//
// Inputs: the finished models, the scenes that they were made from, and the
// summaries and warnings of the stages. Method: figures that need no ground
// truth, each compared with a limit (docs/reference/mapper.md has what they
// detect on worlds with ground truth).

enum class VerdictResult { kGood, kDoubtful, kFailed };

struct Verdict {
  VerdictResult result = VerdictResult::kGood;
  // Why it is not good, the worst first.
  std::vector<std::string> reasons;
  int num_database_images = 0;
  int num_images = 0;
  // Images that see enough points for a pose of their own.
  int num_images_held_by_points = 0;
  int num_points = 0;
  // Over the registered images.
  double median_points_per_image = 0.0;
  bool is_metric = false;  // all models are
  // Source of the metres; empty without metres.
  std::string metric_source;
  // Largest relative 1 sigma of a model's metres
  // (MapperStageSummary::scale_sigma), where known.
  std::optional<double> metric_sigma;
  std::vector<PriorAgreement> priors;
  // Lens error of each camera, in the model where it is largest.
  std::map<camera_t, LensError> lens_errors;
  double keypoint_sigma_px = 0.0;
  double keypoint_sigma_factor = 1.0;
  double mean_reproj_error_px = 0.0;
  int num_models = 1;
  int num_metric_models = 0;
  // The images in no model; set by the caller, for the line and the lists.
  std::vector<LostImage> lost_images;
};

// A finished model with the scene that it was made from; all outlive the
// assessment. A model without images is one that could not be made.
struct AssessedModel {
  const SceneData* data = nullptr;
  const MapperStageSummary* summary = nullptr;
  const colmap::Reconstruction* model = nullptr;
};

// Assesses all models together, the largest first; counts are sums, figures are
// over all images. `rest`: the images that belong to no model's scene.
// `warnings`: those of the import and of the coarse stage.
Verdict AssessModels(const std::vector<AssessedModel>& models,
                     const SceneData& rest,
                     const std::vector<std::string>& warnings);

// Assesses one model; its scene counts as the whole database.
Verdict AssessModel(const SceneData& data, const MapperStageSummary& summary,
                    const std::vector<std::string>& warnings,
                    const colmap::Reconstruction& model);

}  // namespace adasfm
