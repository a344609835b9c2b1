// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/part_checkpoint.h"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace adasfm {
namespace {

namespace fs = std::filesystem;

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
  const std::string temporary_path = path + ".tmp";
  std::error_code error;
  fs::remove_all(temporary_path, error);
  fs::create_directories(temporary_path, error);
  if (error) return Status::Error("cannot create the folder " + temporary_path);
  if (reconstruction != nullptr) reconstruction->WriteBinary(temporary_path);
  nlohmann::json json = AsJson(report);
  json["fingerprint"] = fingerprint;
  {
    std::ofstream file(temporary_path + "/part.json");
    file << json.dump(1) << "\n";
    if (!file) return Status::Error("cannot write to " + temporary_path);
  }
  fs::remove_all(path, error);
  fs::rename(temporary_path, path, error);
  if (error) return Status::Error("cannot write the folder " + path);
  return Status::Ok();
}

StatusOr<PartReport> ReadPartReport(const std::string& path,
                                    const std::string& fingerprint) {
  std::ifstream file(path + "/part.json");
  if (!file) return Status::Error("no part at " + path);
  try {
    const nlohmann::json json = nlohmann::json::parse(file);
    if (json.at("fingerprint").get<std::string>() != fingerprint) {
      return Status::Error("the part at " + path +
                           " was made with other options or another database");
    }
    PartReport report = FromJson(json);
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
      if (report.failure.empty() && !fs::exists(path + "/" + name)) {
        return Status::Error(path + " lacks " + name);
      }
    }
    return report;
  } catch (const nlohmann::json::exception&) {
    return Status::Error(path + "/part.json is damaged");
  }
}

void ReadPartModel(const std::string& path,
                   colmap::Reconstruction* reconstruction) {
  reconstruction->ReadBinary(path);
}

}  // namespace adasfm
