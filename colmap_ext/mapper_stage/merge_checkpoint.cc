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

// Calls visit(name, value) for each stored figure of the summary.
template <typename Alignment, typename Visit>
void VisitAlignment(Alignment& alignment, const Visit& visit) {
  visit("success", alignment.success);
  visit("scale", alignment.target_from_source.scale);
  visit("threshold", alignment.threshold);
  visit("inlier_ratio", alignment.inlier_ratio);
  visit("rmse", alignment.rmse);
  visit("num_iterations", alignment.num_iterations);
}

template <typename Summary, typename Visit>
void VisitSummary(Summary& summary, const Visit& visit) {
  visit("num_separators", summary.aligned.num_separators);
  visit("separator_rmse_before", summary.aligned.separator_rmse_before);
  visit("separator_rmse_after", summary.aligned.separator_rmse_after);
  visit("coarse_images", summary.merge.coarse_images);
  visit("num_points", summary.merge.num_points);
  visit("num_merged_points", summary.merge.num_merged_points);
  visit("num_iterations", summary.refine.num_iterations);
  visit("min_num_shared_points", summary.refine.min_num_shared_points);
  visit("keypoint_sigma_factor", summary.refine.keypoint_sigma_factor);
  visit("keypoint_sigma_px", summary.refine.keypoint_sigma_px);
  visit("keypoint_sigma_ratios", summary.refine.keypoint_sigma_ratios);
  visit("prior_chi2_per_dof", summary.refine.prior_chi2_per_dof);
  visit("unit_sigma", summary.refine.unit_sigma);
  visit("num_images_reset", summary.refine.num_images_reset);
  visit("num_images_deregistered", summary.refine.num_images_deregistered);
  visit("started_from_coarse_poses", summary.started_from_coarse_poses);
}

auto WriteTo(nlohmann::json* json) {
  return [json](const char* name, const auto& value) { (*json)[name] = value; };
}

auto ReadFrom(const nlohmann::json& json) {
  return
      [&json](const char* name, auto& value) { json.at(name).get_to(value); };
}

nlohmann::json AsJson(const MapperStageSummary& summary) {
  nlohmann::json json;
  VisitSummary(summary, WriteTo(&json));
  nlohmann::json& alignments = json["alignments"] = nlohmann::json::array();
  for (const AlignSimilarityResult& alignment : summary.aligned.alignments) {
    VisitAlignment(alignment, WriteTo(&alignments.emplace_back()));
  }
  return json;
}

void SummaryFromJson(const nlohmann::json& json, MapperStageSummary* summary) {
  VisitSummary(*summary, ReadFrom(json));
  std::vector<AlignSimilarityResult>& alignments = summary->aligned.alignments;
  alignments.clear();
  for (const nlohmann::json& alignment : json.at("alignments")) {
    VisitAlignment(alignments.emplace_back(), ReadFrom(alignment));
  }
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

void RemoveEarlierRounds(const std::string& checkpoint_path, int num_rounds) {
  for (int round = 0; round < num_rounds; ++round) {
    std::error_code ignored;
    std::filesystem::remove_all(RoundPath(checkpoint_path, round), ignored);
  }
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
  if (status.ok()) RemoveEarlierRounds(checkpoint_path, num_rounds);
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
    if (read.ok()) {
      // A kill may have left remnants of them.
      RemoveEarlierRounds(checkpoint_path, num_rounds);
      return read;
    }
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
