// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/merge_checkpoint.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper_stage/model_checkpoint.h"

namespace adasfm {
namespace {

std::string RoundPath(const std::string& checkpoint_path, int num_rounds) {
  return checkpoint_path + "/refine_" + std::to_string(num_rounds);
}

nlohmann::json AsJson(const AlignSimilarityResult& alignment) {
  return {{"success", alignment.success},
          {"scale", alignment.target_from_source.scale},
          {"threshold", alignment.threshold},
          {"inlier_ratio", alignment.inlier_ratio},
          {"rmse", alignment.rmse},
          {"num_iterations", alignment.num_iterations}};
}

// What the summary tells of an alignment.
AlignSimilarityResult AlignmentFromJson(const nlohmann::json& json) {
  AlignSimilarityResult alignment;
  json.at("success").get_to(alignment.success);
  json.at("scale").get_to(alignment.target_from_source.scale);
  json.at("threshold").get_to(alignment.threshold);
  json.at("inlier_ratio").get_to(alignment.inlier_ratio);
  json.at("rmse").get_to(alignment.rmse);
  json.at("num_iterations").get_to(alignment.num_iterations);
  return alignment;
}

nlohmann::json AsJson(const MapperStageSummary& summary) {
  nlohmann::json json = {
      {"num_separators", summary.aligned.num_separators},
      {"separator_rmse_before", summary.aligned.separator_rmse_before},
      {"separator_rmse_after", summary.aligned.separator_rmse_after},
      {"coarse_images", summary.merge.coarse_images},
      {"num_points", summary.merge.num_points},
      {"num_merged_points", summary.merge.num_merged_points},
      {"num_iterations", summary.refine.num_iterations},
      {"keypoint_sigma_factor", summary.refine.keypoint_sigma_factor},
      {"keypoint_sigma_px", summary.refine.keypoint_sigma_px},
      {"prior_chi2_per_dof", summary.refine.prior_chi2_per_dof},
      {"num_images_put_back", summary.refine.num_images_put_back},
      {"num_images_left_out", summary.refine.num_images_left_out},
      {"started_from_coarse_poses", summary.started_from_coarse_poses}};
  json["alignments"] = nlohmann::json::array();
  for (const AlignSimilarityResult& alignment : summary.aligned.alignments) {
    json["alignments"].push_back(AsJson(alignment));
  }
  return json;
}

void SummaryFromJson(const nlohmann::json& json, MapperStageSummary* summary) {
  AlignPartsResult& aligned = summary->aligned;
  json.at("num_separators").get_to(aligned.num_separators);
  json.at("separator_rmse_before").get_to(aligned.separator_rmse_before);
  json.at("separator_rmse_after").get_to(aligned.separator_rmse_after);
  aligned.alignments.clear();
  for (const nlohmann::json& alignment : json.at("alignments")) {
    aligned.alignments.push_back(AlignmentFromJson(alignment));
  }
  json.at("coarse_images").get_to(summary->merge.coarse_images);
  json.at("num_points").get_to(summary->merge.num_points);
  json.at("num_merged_points").get_to(summary->merge.num_merged_points);
  RefineModelSummary& refine = summary->refine;
  json.at("num_iterations").get_to(refine.num_iterations);
  json.at("keypoint_sigma_factor").get_to(refine.keypoint_sigma_factor);
  json.at("keypoint_sigma_px").get_to(refine.keypoint_sigma_px);
  json.at("prior_chi2_per_dof").get_to(refine.prior_chi2_per_dof);
  json.at("num_images_put_back").get_to(refine.num_images_put_back);
  json.at("num_images_left_out").get_to(refine.num_images_left_out);
  json.at("started_from_coarse_poses")
      .get_to(summary->started_from_coarse_poses);
}

StatusOr<MergeCheckpoint> ReadRound(const std::string& path,
                                    const std::string& fingerprint,
                                    int num_rounds,
                                    MapperStageSummary* summary) {
  const StatusOr<nlohmann::json> state = ReadCheckpointState(path, fingerprint);
  if (!state.ok()) return state.status();
  StatusOr<colmap::Reconstruction> model = ReadCheckpointModel(path);
  if (!model.ok()) return model.status();
  try {
    if (state->at("num_rounds").get<int>() != num_rounds) {
      return Status::Error(path + " holds another round");
    }
    SummaryFromJson(*state, summary);
  } catch (const nlohmann::json::exception&) {
    return Status::Error(path + " is damaged");
  }
  return MergeCheckpoint{num_rounds, std::move(*model)};
}

}  // namespace

Status WriteMergeCheckpoint(const std::string& checkpoint_path,
                            const std::string& fingerprint, int num_rounds,
                            const MapperStageSummary& summary,
                            const MapperScene& scene) {
  nlohmann::json state = AsJson(summary);
  state["num_rounds"] = num_rounds;
  const Status status =
      WriteModelCheckpoint(RoundPath(checkpoint_path, num_rounds), fingerprint,
                           std::move(state), &scene.reconstruction);
  if (!status.ok()) return status;
  for (int round = 0; round < num_rounds; ++round) {
    std::error_code ignored;
    std::filesystem::remove_all(RoundPath(checkpoint_path, round), ignored);
  }
  return status;
}

StatusOr<MergeCheckpoint> ReadMergeCheckpoint(
    const std::string& checkpoint_path, const std::string& fingerprint,
    MapperStageSummary* summary) {
  std::string problems;
  for (int num_rounds = kNumRefinementRounds; num_rounds >= 0; --num_rounds) {
    const std::string path = RoundPath(checkpoint_path, num_rounds);
    if (!std::filesystem::exists(path)) continue;
    StatusOr<MergeCheckpoint> read =
        ReadRound(path, fingerprint, num_rounds, summary);
    if (read.ok()) return read;
    problems += (problems.empty() ? "" : "; ") + read.status().message();
  }
  return Status::Error(
      problems.empty() ? "no merged model in " + checkpoint_path : problems);
}

void PutIntoScene(const colmap::Reconstruction& model, MapperScene* scene) {
  for (const auto& [camera_id, camera] : model.Cameras()) {
    ParamsOf(&scene->reconstruction.Camera(camera_id)) = ParamsOf(camera);
  }
  for (const auto& [image_id, pose] : CamsFromWorld(model)) {
    scene->mapper.Register(image_id, pose);
  }
  std::vector<colmap::point3D_t> point_ids;
  for (const auto& [point_id, point] : model.Points3D()) {
    point_ids.push_back(point_id);
  }
  std::sort(point_ids.begin(), point_ids.end());
  for (const colmap::point3D_t point_id : point_ids) {
    const colmap::Point3D& point = model.Point3D(point_id);
    const colmap::point3D_t new_id =
        scene->mapper.AddPoint(XyzOf(point), TrackOf(point), ColorOf(point));
    SetError(ErrorOf(point), &scene->reconstruction.Point3D(new_id));
  }
}

}  // namespace adasfm
