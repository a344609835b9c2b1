// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/part_checkpoint.h"

#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_stage/model_checkpoint.h"

namespace adasfm {
namespace {

nlohmann::json AsJson(const PartReport& report) {
  return {
      {"part_index", report.part_index},
      {"failure", report.failure},
      {"num_images", report.num_images},
      {"num_registered", report.num_registered},
      {"num_points", report.num_points},
      {"num_registered_by_global_pose", report.num_registered_by_global_pose},
      {"num_global_adjustments", report.num_global_adjustments},
      {"mean_reproj_error_px", report.mean_reproj_error_px},
      {"keypoint_sigma_factor", report.keypoint_sigma_factor},
      {"seconds", report.seconds},
      {"retry_reason", report.retry_reason},
      {"prior_only_images", report.prior_only_images}};
}

PartReport FromJson(const nlohmann::json& json) {
  PartReport report;
  json.at("part_index").get_to(report.part_index);
  json.at("failure").get_to(report.failure);
  json.at("num_images").get_to(report.num_images);
  json.at("num_registered").get_to(report.num_registered);
  json.at("num_points").get_to(report.num_points);
  json.at("num_registered_by_global_pose")
      .get_to(report.num_registered_by_global_pose);
  json.at("num_global_adjustments").get_to(report.num_global_adjustments);
  json.at("mean_reproj_error_px").get_to(report.mean_reproj_error_px);
  json.at("keypoint_sigma_factor").get_to(report.keypoint_sigma_factor);
  json.at("seconds").get_to(report.seconds);
  json.at("retry_reason").get_to(report.retry_reason);
  json.at("prior_only_images").get_to(report.prior_only_images);
  return report;
}

}  // namespace

Status WritePartCheckpoint(const std::string& path,
                           const std::string& fingerprint,
                           const PartReport& report,
                           const colmap::Reconstruction* reconstruction) {
  return WriteModelCheckpoint(path, fingerprint, AsJson(report),
                              reconstruction);
}

StatusOr<PartReport> ReadPartReport(const std::string& path,
                                    const std::string& fingerprint,
                                    int part_index) {
  const StatusOr<nlohmann::json> state = ReadCheckpointState(path, fingerprint);
  if (!state.ok()) return state.status();
  try {
    PartReport report = FromJson(*state);
    if (report.part_index != part_index) {
      return Status::Error(path + " holds part " +
                           std::to_string(report.part_index));
    }
    if (report.failure.empty() && !state->contains("files")) {
      return Status::Error(path + " has no model");
    }
    return report;
  } catch (const nlohmann::json::exception&) {
    return Status::Error("the part at " + path + " is damaged");
  }
}

StatusOr<colmap::Reconstruction> ReadPartModel(const std::string& path) {
  return ReadCheckpointModel(path);
}

}  // namespace adasfm
