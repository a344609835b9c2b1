// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/colmap.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// One image of the report; world is that of the final model.
struct ReportImage {
  image_t image_id = kInvalidImageId;
  std::string name;
  std::optional<timestamp_t> timestamp_ns;
  std::optional<Rigid3d> cam_from_world;
  std::optional<Rigid3d> coarse_cam_from_world;
  // Pose from chaining the priors, starting at the first image of their run.
  std::optional<Rigid3d> prior_cam_from_world;
  int prior_run = -1;
  std::optional<Eigen::Vector3d> true_center;
  // After the alignment, in metres.
  std::optional<double> error_m;
  std::optional<double> coarse_error_m;
  // The first part with this image, and the number of parts with it.
  int part = -1;
  int num_parts = 0;
};

struct ReportScene {
  // In order of time, or of name where times are missing.
  std::vector<ReportImage> images;
  std::map<std::string, size_t> index_of_name;
  std::map<image_t, size_t> index_of_id;
  // Rotates the world so that z points up.
  Eigen::Quaterniond level_from_world = Eigen::Quaterniond::Identity();
};

// The images of the database (by id and name) and of both models; the coarse
// model may be null.
ReportScene BuildReportScene(
    const std::map<image_t, std::string>& database_images,
    const colmap::Reconstruction& reconstruction,
    const colmap::Reconstruction* coarse, const PriorTables& priors);

// Chains the priors with rotation and metric translation, from the first image
// of each unbroken run.
void ChainPriors(const std::vector<RelativePosePrior>& priors,
                 ReportScene* scene);

// Assigns the parts of the mapper's plan (lists of image ids) to the images.
void MarkParts(const std::vector<std::vector<image_t>>& parts,
               ReportScene* scene);

// Aligns the truth to the model, with scale 1 when the model is metric, and
// computes each image's error, for each model after its own alignment.
void AlignTruth(const std::map<std::string, Rigid3d>& true_cams_from_world,
                bool is_metric, ReportScene* scene);

// For the page: packed arrays, one entry per image.
nlohmann::json SceneToJson(const ReportScene& scene);

// Positions (levelled) and colours of at most max_num_points points, evenly
// sampled by id; no colours when the model has none.
nlohmann::json PointsToJson(const colmap::Reconstruction& reconstruction,
                            const ReportScene& scene, int max_num_points);

}  // namespace adasfm
