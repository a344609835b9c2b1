// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/verdict_report.h"

#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "colmap_ext/mapper_stage/lost_images.h"

namespace adasfm {

std::string FormatShare(double share) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(share > 0.0 && share < 0.1 ? 1 : 0)
       << 100.0 * share << " %";
  return text.str();
}

std::string FormatOfModels(int num_models, int num_all_models) {
  if (num_models == num_all_models) return "";
  return "of " + std::to_string(num_models) + " of " +
         std::to_string(num_all_models) + " models ";
}

const char* VerdictName(VerdictResult result) {
  switch (result) {
    case VerdictResult::kGood:
      return "good";
    case VerdictResult::kDoubtful:
      return "doubtful";
    case VerdictResult::kFailed:
      break;
  }
  return "failed";
}

std::string FormatVerdict(const Verdict& verdict) {
  std::ostringstream text;
  text << "Verdict: " << VerdictName(verdict.result);
  for (size_t i = 0; i < verdict.reasons.size(); ++i) {
    text << (i == 0 ? ": " : "; ") << verdict.reasons[i];
  }
  text << ". " << verdict.num_images << " of " << verdict.num_database_images
       << " images, "
       << (verdict.num_models == 1
               ? ""
               : "in " + std::to_string(verdict.num_models) + " models, ")
       << verdict.num_points << " points, "
       << static_cast<int>(verdict.median_points_per_image) << " an image, "
       << (verdict.num_metric_models == 0
               ? "no metres"
               : FormatOfModels(verdict.num_metric_models, verdict.num_models) +
                     "in metres from " + verdict.metric_source);
  if (verdict.num_metric_models > 0 && verdict.metric_sigma) {
    text << " (to " << std::setprecision(2) << 100.0 * *verdict.metric_sigma
         << " %)";
  }
  for (const PriorAgreement& priors : verdict.priors) {
    text << ", " << priors.kind << "s agree to "
         << FormatShare(1.0 - priors.share_contradicting);
  }
  if (!verdict.lost_images.empty()) {
    text << ". In no model: " << DescribeLostImages(verdict.lost_images);
  }
  return text.str();
}

nlohmann::json VerdictToJson(const Verdict& verdict) {
  nlohmann::json json = {
      {"result", VerdictName(verdict.result)},
      {"line", FormatVerdict(verdict)},
      {"reasons", verdict.reasons},
      {"num_database_images", verdict.num_database_images},
      {"num_images", verdict.num_images},
      {"num_models", verdict.num_models},
      {"num_images_held_by_points", verdict.num_images_held_by_points},
      {"num_points", verdict.num_points},
      {"median_points_per_image", verdict.median_points_per_image},
      {"is_metric", verdict.is_metric},
      {"num_metric_models", verdict.num_metric_models},
      {"metric_source", verdict.metric_source},
      {"keypoint_sigma_px", verdict.keypoint_sigma_px},
      {"keypoint_sigma_factor", verdict.keypoint_sigma_factor},
      {"mean_reproj_error_px", verdict.mean_reproj_error_px}};
  if (verdict.metric_sigma) json["metric_sigma"] = *verdict.metric_sigma;
  json["priors"] = nlohmann::json::array();
  for (const PriorAgreement& priors : verdict.priors) {
    json["priors"].push_back(
        {{"kind", priors.kind},
         {"num_priors", priors.num_priors},
         {"chi2_ratio", priors.chi2_ratio},
         {"share_contradicting", priors.share_contradicting}});
  }
  json["lenses"] = nlohmann::json::array();
  for (const auto& [camera_id, error] : verdict.lens_errors) {
    json["lenses"].push_back({{"camera_id", camera_id},
                              {"rms_px", error.rms_px},
                              {"ratio", error.ratio}});
  }
  return json;
}

}  // namespace adasfm
