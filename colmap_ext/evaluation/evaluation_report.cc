// SPDX-License-Identifier: BSD-3-Clause
#include <cstdarg>
#include <nlohmann/json.hpp>

#include "colmap_ext/evaluation/evaluation.h"

namespace adasfm {
namespace {

std::string Format(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  char buffer[256];
  std::vsnprintf(buffer, sizeof(buffer), format, arguments);
  va_end(arguments);
  return buffer;
}

std::string FormatErrors(const char* name, const AlignmentErrors& errors) {
  return Format("%-20s %9.5f %9.4f %9.4f %9.4f %9.4f %9.4f %9.4f\n", name,
                errors.scale, errors.translation_rmse_m,
                errors.translation_mean_m, errors.translation_median_m,
                errors.translation_max_m, errors.rotation_mean_deg,
                errors.rotation_median_deg);
}

nlohmann::ordered_json ErrorsToJson(const AlignmentErrors& errors) {
  return {{"scale", errors.scale},
          {"translation_rmse_m", errors.translation_rmse_m},
          {"translation_mean_m", errors.translation_mean_m},
          {"translation_median_m", errors.translation_median_m},
          {"translation_max_m", errors.translation_max_m},
          {"rotation_mean_deg", errors.rotation_mean_deg},
          {"rotation_median_deg", errors.rotation_median_deg}};
}

}  // namespace

std::string FormatEvaluation(const Evaluation& evaluation) {
  std::string text;
  text += Format("models              %d%s\n", evaluation.num_models,
                 evaluation.num_models > 1 ? " (the largest is compared)" : "");
  text += Format("images              %d, ground truth %d, in both %d\n",
                 evaluation.num_images, evaluation.num_true_images,
                 evaluation.num_common_images);
  text += Format("points              %lld\n",
                 static_cast<long long>(evaluation.num_points));
  text += Format("mean track length   %.2f\n", evaluation.mean_track_length);
  text += Format("RMSE                %.3f px\n\n", evaluation.rmse_px);
  text +=
      Format("%-20s %9s %9s %9s %9s %9s %9s %9s\n", "alignment", "scale",
             "RMSE m", "mean m", "median m", "max m", "mean deg", "med. deg");
  text += FormatErrors("Sim3, robust", evaluation.sim3);
  text += FormatErrors("Sim3, least squares", evaluation.sim3_least_squares);
  text += FormatErrors("SE3, robust", evaluation.se3);
  text += FormatErrors("SE3, least squares", evaluation.se3_least_squares);
  text += Format("orientations alone   median %.4f deg\n",
                 evaluation.orientation_median_deg);
  text += "\nrelative poses, area under the recall curve in percent\n";
  text += Format("%-10s %9s %9s\n", "up to deg", "R", "t");
  for (const RelativePoseAuc& auc : evaluation.relative_pose_auc) {
    text += Format("%-10g %9.2f %9.2f\n", auc.threshold_deg,
                   auc.rotation_percent, auc.translation_percent);
  }
  return text;
}

std::string EvaluationToJson(const Evaluation& evaluation) {
  nlohmann::ordered_json json = {
      {"num_models", evaluation.num_models},
      {"num_images", evaluation.num_images},
      {"num_true_images", evaluation.num_true_images},
      {"num_common_images", evaluation.num_common_images},
      {"num_points", evaluation.num_points},
      {"mean_track_length", evaluation.mean_track_length},
      {"rmse_px", evaluation.rmse_px},
      {"sim3", ErrorsToJson(evaluation.sim3)},
      {"sim3_least_squares", ErrorsToJson(evaluation.sim3_least_squares)},
      {"se3", ErrorsToJson(evaluation.se3)},
      {"se3_least_squares", ErrorsToJson(evaluation.se3_least_squares)},
      {"orientation_median_deg", evaluation.orientation_median_deg}};
  for (const RelativePoseAuc& auc : evaluation.relative_pose_auc) {
    json["relative_pose_auc"].push_back(
        {{"threshold_deg", auc.threshold_deg},
         {"rotation_percent", auc.rotation_percent},
         {"translation_percent", auc.translation_percent}});
  }
  return json.dump(2);
}

}  // namespace adasfm
