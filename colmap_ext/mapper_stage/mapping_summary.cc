// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/mapping_summary.h"

#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_stage/verdict_report.h"

namespace adasfm {
namespace {

nlohmann::json ModelAsJson(const ModelSummary& model) {
  return {{"coarse_model", model.coarse_index},
          {"num_images", model.stage.num_images},
          {"num_points", model.stage.num_points},
          {"mean_reproj_error_px", model.stage.mean_reproj_error_px},
          {"is_metric", model.stage.is_metric},
          {"is_level", model.stage.is_level},
          {"num_parts", model.stage.parts.size()},
          {"verdict", VerdictToJson(model.verdict)}};
}

// Adds the times of a further model to those of the first.
void AddTimes(const MapperStageSummary& stage, nlohmann::json* json) {
  const std::pair<const char*, double> times[] = {
      {"plan_seconds", stage.plan_seconds},
      {"parts_seconds", stage.parts_seconds},
      {"merge_seconds", stage.merge_seconds},
      {"refine_seconds", stage.refine_seconds}};
  for (const auto& [name, seconds] : times) {
    (*json)[name] = json->at(name).get<double>() + seconds;
  }
}

}  // namespace

std::string FormatMappingJson(const std::vector<ModelSummary>& models,
                              const Verdict& verdict) {
  nlohmann::json json = MapperSummaryToJson(models.front().stage);
  json["models"] = nlohmann::json::array();
  nlohmann::json parts = nlohmann::json::array();
  for (size_t k = 0; k < models.size(); ++k) {
    json["models"].push_back(ModelAsJson(models[k]));
    if (k > 0) AddTimes(models[k].stage, &json);
    const nlohmann::json stage = MapperSummaryToJson(models[k].stage);
    for (nlohmann::json part : stage.at("parts")) {
      part["model"] = k;
      parts.push_back(std::move(part));
    }
  }
  json["parts"] = std::move(parts);
  json["images_in_no_model"] = LostImagesToJson(verdict.lost_images);
  json["verdict"] = VerdictToJson(verdict);
  return json.dump(1) + "\n";
}

std::string FormatMappingText(const std::vector<ModelSummary>& models) {
  std::string text;
  for (size_t k = 0; k < models.size(); ++k) {
    if (models.size() > 1) {
      text += "Model " + std::to_string(k) + ", of the coarse model " +
              std::to_string(models[k].coarse_index) + ":\n";
    }
    text += FormatMapperSummaryText(models[k].stage);
  }
  return text;
}

}  // namespace adasfm
