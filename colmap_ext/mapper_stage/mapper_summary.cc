// SPDX-License-Identifier: BSD-3-Clause
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "colmap_ext/mapper_stage/mapping_summary.h"

namespace adasfm {
namespace {

nlohmann::json PartAsJson(const MapperStageSummary& summary, size_t k) {
  const PartReport& part = summary.parts[k];
  nlohmann::json json = {
      {"part_index", part.part_index},
      {"num_images", part.num_images},
      {"num_registered", part.num_registered},
      {"num_points", part.num_points},
      {"num_registered_by_global_pose", part.num_registered_by_global_pose},
      {"num_prior_only_images", part.prior_only_images.size()},
      {"num_global_adjustments", part.num_global_adjustments},
      {"mean_reproj_error_px", part.mean_reproj_error_px},
      {"seconds", part.seconds},
      {"failure", part.failure},
      {"retry_reason", part.retry_reason},
      {"overlap_ratio", summary.plan.overlap_ratios[k]}};
  if (k < summary.aligned.alignments.size()) {
    const AlignSimilarityResult& alignment = summary.aligned.alignments[k];
    json["merged"] = alignment.success;
    json["inlier_ratio"] = alignment.inlier_ratio;
    json["threshold"] = alignment.threshold;
    json["num_thresholds_tried"] = alignment.num_iterations;
    json["alignment_rmse"] = alignment.rmse;
    json["scale"] = alignment.target_from_source.scale;
  }
  return json;
}

}  // namespace

nlohmann::json MapperSummaryToJson(const MapperStageSummary& summary) {
  nlohmann::json json = {
      {"num_images", summary.num_images},
      {"num_points", summary.num_points},
      {"mean_reproj_error_px", summary.mean_reproj_error_px},
      {"is_metric", summary.is_metric},
      {"is_georeferenced", summary.is_georeferenced},
      {"is_level", summary.is_level},
      {"num_separators", summary.aligned.num_separators},
      {"separator_rmse_before", summary.aligned.separator_rmse_before},
      {"separator_rmse_after", summary.aligned.separator_rmse_after},
      {"coarse_images", summary.merge.coarse_images},
      {"started_from_coarse_poses", summary.started_from_coarse_poses},
      {"num_merged_points", summary.merge.num_merged_points},
      {"num_images_reset", summary.refine.num_images_reset},
      {"num_images_deregistered", summary.refine.num_images_deregistered},
      {"num_refinement_iterations", summary.refine.num_iterations},
      {"min_num_shared_points", summary.refine.min_num_shared_points},
      {"keypoint_sigma_px", summary.refine.keypoint_sigma_px},
      {"prior_chi2_per_dof", summary.refine.prior_chi2_per_dof},
      {"num_parallel_parts", summary.num_parallel_parts},
      {"max_part_memory_bytes", summary.max_part_memory_bytes},
      {"plan_seconds", summary.plan_seconds},
      {"parts_seconds", summary.parts_seconds},
      {"merge_seconds", summary.merge_seconds},
      {"refine_seconds", summary.refine_seconds}};
  nlohmann::json& of_cameras = json["keypoint_sigma_px_of_cameras"] =
      nlohmann::json::object();
  for (const auto& [camera_id, ratio] : summary.refine.keypoint_sigma_ratios) {
    of_cameras[std::to_string(camera_id)] =
        ratio * summary.refine.keypoint_sigma_px;
  }
  json["parts"] = nlohmann::json::array();
  for (size_t k = 0; k < summary.parts.size(); ++k) {
    json["parts"].push_back(PartAsJson(summary, k));
  }
  return json;
}

std::string FormatMapperSummaryText(const MapperStageSummary& summary) {
  const char* unit = summary.is_metric ? " m" : " units";
  std::ostringstream text;
  text << std::fixed << std::setprecision(2);
  text << "part  images  registered  points  error px  inliers  threshold"
          "  seconds\n";
  for (size_t k = 0; k < summary.parts.size(); ++k) {
    const PartReport& part = summary.parts[k];
    text << std::setw(4) << part.part_index << std::setw(8) << part.num_images
         << std::setw(12) << part.num_registered << std::setw(8)
         << part.num_points << std::setw(10) << part.mean_reproj_error_px;
    if (k < summary.aligned.alignments.size()) {
      const AlignSimilarityResult& alignment = summary.aligned.alignments[k];
      text << std::setw(9) << alignment.inlier_ratio << std::setw(11)
           << alignment.threshold << std::setw(9) << part.seconds;
      if (!part.failure.empty()) {
        text << "  FAILED: " << part.failure;
      } else if (!alignment.success) {
        text << "  DOES NOT FIT the coarse model, not merged";
      }
    }
    text << "\n";
  }
  text << "separators: " << summary.aligned.num_separators << ", RMSE "
       << std::setprecision(3) << summary.aligned.separator_rmse_before << unit
       << " before, " << summary.aligned.separator_rmse_after << unit
       << " after the joint alignment of the parts\n";
  text << "model: " << summary.num_images << " images, " << summary.num_points
       << " points, " << std::setprecision(2) << summary.mean_reproj_error_px
       << " px; " << summary.merge.coarse_images.size()
       << " images started from coarse poses, "
       << summary.refine.num_images_reset
       << " contradicted the priors and were reset to their coarse poses, "
       << summary.refine.num_images_deregistered
       << " whose pose nothing determines were deregistered\n";
  if (summary.started_from_coarse_poses) {
    text << "the merged parts violated priors: the model was refined "
            "from the coarse poses\n";
  }
  if (summary.refine.min_num_shared_points > 1) {
    text << "to save memory, bundle adjustments treated images that share "
            "fewer than "
         << summary.refine.min_num_shared_points
         << " points as if they shared none\n";
  }
  text << "seconds: plan " << summary.plan_seconds << ", parts "
       << summary.parts_seconds << ", merge " << summary.merge_seconds
       << ", refinement " << summary.refine_seconds << "\n";
  return text.str();
}

}  // namespace adasfm
