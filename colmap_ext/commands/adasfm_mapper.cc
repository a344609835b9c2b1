// SPDX-License-Identifier: BSD-3-Clause
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <mutex>
#include <string>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper_stage.h"
#include "colmap_ext/model_folder.h"

namespace adasfm {
namespace {

struct MapperCommandOptions {
  std::string database_path;
  std::string input_path;
  std::string output_path;
  std::string stage = "all";
  int part_index = -1;
  // -1: refined for cameras without a prior focal length.
  int refine_focal_length = -1;
  int refine_extra_params = -1;
  MapperStageOptions mapper;
};

void AddPartitionOptions(MapperStageOptions* options, CommandOptions* command) {
  PartitionPlanOptions& partition = options->partition;
  command->AddDefault("AdaSfmPartition.max_part_size",
                      &partition.cut.max_part_size,
                      "images of a part before the overlap");
  command->AddDefault("AdaSfmPartition.min_part_size",
                      &partition.cut.min_part_size,
                      "smaller pieces join a neighbour");
  command->AddDefault("AdaSfmPartition.min_overlap_ratio",
                      &partition.flood_fill.min_overlap_ratio,
                      "share of a part that other parts have too");
  command->AddDefault("AdaSfmPartition.max_num_images_undivided",
                      &partition.max_num_images_undivided,
                      "up to this many images the scene is one part");
}

void AddAlignOptions(AlignSimilarityOptions* align, CommandOptions* command) {
  command->AddDefault("AdaSfmAlign.initial_threshold",
                      &align->initial_threshold,
                      "tau_init: first threshold [m, or median distances of "
                      "neighbouring images]");
  command->AddDefault("AdaSfmAlign.threshold_increase",
                      &align->threshold_increase,
                      "alpha_inc: step by which it rises [as tau_init]");
  command->AddDefault("AdaSfmAlign.threshold_decrease",
                      &align->threshold_decrease,
                      "alpha_dec: step by which it falls [as tau_init]");
  command->AddDefault("AdaSfmAlign.min_threshold", &align->min_threshold,
                      "no threshold falls below this [as tau_init]");
  command->AddDefault("AdaSfmAlign.min_inlier_ratio", &align->min_inlier_ratio,
                      "r_min: a part below it is not merged");
  command->AddDefault("AdaSfmAlign.max_inlier_ratio", &align->max_inlier_ratio,
                      "r_max: from it on the threshold is lowered");
  command->AddDefault("AdaSfmAlign.max_num_iterations",
                      &align->max_num_iterations, "thresholds tried at most");
  command->AddDefault(
      "AdaSfmAlign.adapt_threshold", &align->adapt_threshold,
      "let the threshold rise and fall; 0: tau_init is used as it is");
}

void AddMapperOptions(MapperCommandOptions* options, CommandOptions* command) {
  LocalMapperOptions& local = options->mapper.local;
  const auto add = [command](const std::string& name, auto* value,
                             const std::string& help) {
    command->AddDefault("AdaSfmMapper." + name, value, help);
  };
  add("stage", &options->stage, "what to run: all, plan, part or merge");
  add("part_index", &options->part_index,
      "which part --AdaSfmMapper.stage part makes, from 0");
  add("min_num_visible_points", &local.registration.min_num_visible_points,
      "v_p: points that an image must see");
  add("max_reproj_error_px", &local.registration.max_reproj_error_px,
      "inliers of a candidate pose [px]");
  add("use_global_candidate", &local.registration.use_global_candidate,
      "coarse poses as candidates beside P3P");
  add("use_priors_in_adjustment", &local.use_priors_in_adjustment,
      "sensor priors as terms of the bundle adjustment");
  add("keypoint_sigma_px", &local.keypoint_sigma_px,
      "1 sigma of keypoints, weighs priors [px]");
  add("balance_priors", &local.balance.enabled,
      "raise the keypoint sigma until the priors agree within their "
      "covariance");
  add("max_prior_chi2", &local.balance.max_chi2_per_dof,
      "squared whitened residual per degree of freedom that priors may have");
  add("max_keypoint_sigma_factor", &local.balance.max_sigma_factor,
      "largest factor by which the keypoint sigma is raised");
  add("filter_max_reproj_error_px", &local.filter_max_reproj_error_px,
      "observations beyond it are removed [px]");
  add("min_triangulation_angle_deg", &local.min_triangulation_angle_deg,
      "points below it are removed [deg]");
  add("global_adjustment_growth", &local.global_adjustment_growth,
      "a part is adjusted as a whole when it has grown by this factor");
  add("refine_focal_length", &options->refine_focal_length,
      "adjust focal lengths at the end: 0, 1, or -1: when they are not known");
  add("refine_principal_point", &options->mapper.refine.refine_principal_point,
      "adjust principal points at the end");
  add("refine_extra_params", &options->refine_extra_params,
      "adjust distortion at the end: 0, 1, or -1: when the focal length is not "
      "known");
  add("max_num_parallel_parts", &options->mapper.max_num_parallel_parts,
      "parts at a time; -1: as threads and memory allow");
  command->AddDefault("num_threads", &options->mapper.num_threads,
                      "threads; -1: all of the machine's");
}

Status CheckPaths(const MapperCommandOptions& options) {
  if (access(options.database_path.c_str(), R_OK) != 0) {
    return Status::Error("cannot read the database " + options.database_path);
  }
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string path = options.input_path + "/" + name;
    if (access((path + ".bin").c_str(), R_OK) != 0 &&
        access((path + ".txt").c_str(), R_OK) != 0) {
      return Status::Error("no coarse model at --input_path " +
                           options.input_path + ": " + name +
                           ".bin is missing; run adasfm_global first");
    }
  }
  return PrepareOutputFolder(options.output_path);
}

StatusOr<CoarsePoseMap> ReadCoarsePoses(const std::string& path,
                                        const SceneData& data) {
  colmap::Reconstruction reconstruction;
  reconstruction.Read(path);
  CoarsePoseMap poses;
  for (const image_t image_id : reconstruction.RegImageIds()) {
    const colmap::Image& image = reconstruction.Image(image_id);
    const auto source = data.images.find(image_id);
    if (source == data.images.end() || source->second.name != image.Name()) {
      return Status::Error("image " + image.Name() + " of the coarse model " +
                           path +
                           " is not in the database under its id; use "
                           "the model that adasfm_global made from it");
    }
    poses[image_id] = CamFromWorld(image);
  }
  if (poses.size() < 2) {
    return Status::Error("the coarse model " + path +
                         " has fewer than two images");
  }
  return poses;
}

// Intrinsics that nobody has measured are refined; a calibrated robot's are
// left alone.
void ResolveIntrinsics(const SceneData& data, MapperCommandOptions* options) {
  bool is_calibrated = true;
  for (const auto& [camera_id, camera] : data.cameras) {
    is_calibrated = is_calibrated && camera.HasPriorFocalLength();
  }
  RefineModelOptions& refine = options->mapper.refine;
  refine.refine_focal_length = options->refine_focal_length < 0
                                   ? !is_calibrated
                                   : options->refine_focal_length != 0;
  refine.refine_extra_params = options->refine_extra_params < 0
                                   ? !is_calibrated
                                   : options->refine_extra_params != 0;
  // The thresholds that local mapping and refinement share.
  const LocalMapperOptions& local = options->mapper.local;
  refine.use_priors_in_adjustment = local.use_priors_in_adjustment;
  refine.filter_max_reproj_error_px = local.filter_max_reproj_error_px;
  refine.min_triangulation_angle_deg = local.min_triangulation_angle_deg;
  refine.keypoint_sigma_px = local.keypoint_sigma_px;
  refine.balance = local.balance;
}

Status WriteText(const std::string& path, const std::string& text) {
  std::ofstream file(path + ".tmp");
  file << text;
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(path + ".tmp", path, error);
  if (!file || error) return Status::Error("cannot write " + path);
  return Status::Ok();
}

Status MergeAndWrite(const MapperCommandOptions& options,
                     bool require_all_parts, MapperStage* stage) {
  const StatusOr<colmap::Reconstruction> model =
      stage->Merge(require_all_parts);
  if (!model.ok()) return model.status();
  Status status = WriteModelFolder(options.output_path, {&*model});
  if (status.ok()) {
    status = WriteText(options.output_path + "/summary.json",
                       FormatMapperSummaryJson(stage->Summary()));
  }
  std::cout << FormatMapperSummaryText(stage->Summary()) << std::flush;
  return status;
}

Status RunStage(const MapperCommandOptions& options, MapperStage* stage) {
  if (options.stage == "plan") return stage->Plan();
  if (options.stage == "part") return stage->RunPart(options.part_index);
  if (options.stage == "merge") return MergeAndWrite(options, true, stage);
  Status status = stage->Plan();
  if (status.ok()) status = stage->RunAllParts();
  if (status.ok()) status = MergeAndWrite(options, true, stage);
  return status;
}

}  // namespace

Status RunAdasfmMapper(int argc, char** argv) {
  MapperCommandOptions options;
  CommandOptions command(
      "adasfm_mapper",
      "Reconstructs overlapping parts incrementally, steered by the coarse "
      "model, and merges them into one.");
  command.AddRequired("database_path", &options.database_path,
                      "COLMAP database with verified matches");
  command.AddRequired("input_path", &options.input_path,
                      "coarse model that adasfm_global made");
  command.AddRequired("output_path", &options.output_path,
                      "folder for the model (0) and checkpoints");
  AddMapperOptions(&options, &command);
  AddPartitionOptions(&options.mapper, &command);
  AddAlignOptions(&options.mapper.align, &command);
  Status status = command.Parse(argc, argv);
  if (!status.ok() || command.HelpShown()) return status;
  if (options.stage != "all" && options.stage != "plan" &&
      options.stage != "part" && options.stage != "merge") {
    return Status::Error("AdaSfmMapper.stage = " + options.stage +
                         " must be all, plan, part or merge");
  }
  status = CheckOptions(options.mapper);
  if (status.ok()) status = CheckPaths(options);
  if (!status.ok()) return status;
  const StatusOr<SceneData> data = ReadSceneData(options.database_path, {});
  if (!data.ok()) return data.status();
  const StatusOr<CoarsePoseMap> coarse =
      ReadCoarsePoses(options.input_path, *data);
  if (!coarse.ok()) return coarse.status();
  ResolveIntrinsics(*data, &options);
  if (data->priors.empty()) {
    std::cout << "WARNING: the database has no sensor priors; the model will "
                 "have no metric scale (adasfm_prior_importer adds them)"
              << std::endl;
  }
  std::mutex mutex;
  MapperStage stage(options.mapper, *data, *coarse, options.output_path,
                    [&mutex](const std::string& line, double share_done) {
                      const std::lock_guard<std::mutex> lock(mutex);
                      std::cout << "[" << static_cast<int>(100.0 * share_done)
                                << " %] " << line << std::endl;
                    });
  return RunStage(options, &stage);
}

}  // namespace adasfm
