// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/adasfm_pipeline.h"

#include <unistd.h>

#include <chrono>
#include <sstream>

#include "colmap_ext/commands/command.h"
#include "colmap_ext/global_report.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/model_folder.h"
#include "colmap_ext/two_view_geometry_backup.h"

namespace adasfm {
namespace {

constexpr char kNoPriorsWarning[] =
    "the database has no sensor priors; the model will have no metric scale "
    "(adasfm_prior_importer adds them)";

// Before any work: nothing is lost when the result cannot be written.
Status CheckGlobalPaths(const GlobalStageOptions& options,
                        const std::string& database_path,
                        const std::string& output_path) {
  const Status status = CheckDatabase(database_path);
  if (!status.ok()) return status;
  if (options.refinement.enabled && access(database_path.c_str(), W_OK) != 0) {
    return Status::Error("the database " + database_path +
                         " is not writable; change its permissions or use "
                         "--AdaSfmGlobal.refine_matches 0");
  }
  return PrepareOutputFolder(output_path);
}

// The models first: a crash in between leaves the database as it was.
Status WriteGlobalResult(const GlobalStageOptions& options,
                         const std::string& database_path,
                         const std::string& output_path, const SceneData& scene,
                         const CoarseModelReport& report) {
  const GlobalStageResult& result = report.result;
  std::vector<const colmap::Reconstruction*> models;
  for (const CoarseModel& model : result.models) {
    models.push_back(&model.reconstruction);
  }
  Status status = WriteModelFolder(output_path, models);
  if (status.ok()) {
    status = WriteTextFile(output_path + "/removed_pairs.txt",
                           FormatRemovedPairs(scene, result.removed_pairs));
  }
  if (status.ok() && options.refinement.enabled) {
    status = RewriteTwoViewGeometries(database_path, result.geometries,
                                      result.removed_pairs);
  }
  if (status.ok()) {
    status =
        WriteTextFile(output_path + "/summary.json",
                      FormatGlobalReportJson(scene, result, report.seconds));
  }
  return status;
}

// The poses of a coarse model, whose images must be the scene's.
StatusOr<CoarsePoseMap> ReadCoarsePoses(const std::string& path,
                                        const SceneData& scene) {
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = path + "/" + name;
    if (access((file + ".bin").c_str(), R_OK) != 0 &&
        access((file + ".txt").c_str(), R_OK) != 0) {
      return Status::Error("no coarse model in " + path + ": " + name +
                           ".bin is missing; run adasfm_global first");
    }
  }
  colmap::Reconstruction reconstruction;
  reconstruction.Read(path);
  const CoarsePoseMap poses = CamsFromWorld(reconstruction);
  for (const auto& [image_id, pose] : poses) {
    const std::string& name = reconstruction.Image(image_id).Name();
    const auto image = scene.images.find(image_id);
    if (image == scene.images.end() || image->second.name != name) {
      return Status::Error("image " + name + " of the coarse model " + path +
                           " is not in the database under its id; use the "
                           "model that adasfm_global made from it");
    }
  }
  return poses;
}

}  // namespace

bool AdaSfmOptions::IsValid(std::string* error) const {
  return priors.IsValid(error) && global.IsValid(error) &&
         mapper.IsValid(error);
}

StatusOr<PriorImport> ImportPriors(const PriorImportOptions& options,
                                   const PriorImportPaths& paths) {
  StatusOr<PriorImport> import = ComputePriorImport(paths, options);
  if (!import.ok()) return import;
  const Status status = WritePriorTables(paths.database_path, import->tables);
  if (!status.ok()) return status;
  return import;
}

StatusOr<CoarseModelReport> EstimateCoarseModel(
    const GlobalStageOptions& options, const std::string& database_path,
    const std::string& output_path, const PipelineProgress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [start] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start)
        .count();
  };
  Status status = CheckOptions(options);
  if (status.ok()) {
    status = CheckGlobalPaths(options, database_path, output_path);
  }
  if (!status.ok()) return status;

  if (progress) progress("reading", 0.0);
  SceneDataOptions scene_options;
  scene_options.read_raw_matches = options.refinement.enabled;
  scene_options.use_original_two_view_geometries = true;
  scene_options.min_num_matches = options.poses.min_num_inliers;
  const StatusOr<SceneData> scene = ReadSceneData(database_path, scene_options);
  if (!scene.ok()) return scene.status();
  std::ostringstream text;
  text << scene->images.size() << " images, " << scene->pairs.size()
       << " verified pairs, " << scene->priors.size() << " priors";
  const StepReport reading = {"reading", seconds(), text.str()};

  CoarseModelReport report;
  report.warnings = scene->warnings;
  if (scene->priors.empty()) report.warnings.push_back(kNoPriorsWarning);
  StatusOr<GlobalStageResult> result =
      RunGlobalStage(options, *scene, progress);
  if (!result.ok()) return result.status();
  report.result = std::move(result).value();
  report.result.steps.insert(report.result.steps.begin(), reading);
  report.seconds = seconds();
  status =
      WriteGlobalResult(options, database_path, output_path, *scene, report);
  if (!status.ok()) return status;
  report.result.steps.push_back(
      {"writing", seconds() - report.seconds, "models and matches"});
  report.seconds = seconds();
  return report;
}

StatusOr<MapReport> MapParts(const MapperStageOptions& options,
                             const std::string& database_path,
                             const std::string& input_path,
                             const std::string& output_path,
                             const PipelineProgress& progress) {
  Status status = CheckOptions(options);
  if (status.ok()) status = PrepareOutputFolder(output_path);
  if (!status.ok()) return status;
  const StatusOr<SceneData> scene = ReadSceneData(database_path, {});
  if (!scene.ok()) return scene.status();
  const StatusOr<CoarsePoseMap> coarse = ReadCoarsePoses(input_path, *scene);
  if (!coarse.ok()) return coarse.status();

  MapReport report;
  report.warnings = scene->warnings;
  if (scene->priors.empty()) report.warnings.push_back(kNoPriorsWarning);
  MapperStage stage(options, *scene, *coarse, output_path, progress);
  status = stage.Plan();
  if (status.ok()) status = stage.RunAllParts();
  if (!status.ok()) return status;
  const StatusOr<colmap::Reconstruction> model = stage.Merge(true);
  if (!model.ok()) return model.status();
  report.summary = stage.Summary();
  status = WriteModelFolder(output_path, {&*model});
  if (status.ok()) {
    status = WriteTextFile(output_path + "/summary.json",
                           FormatMapperSummaryJson(report.summary));
  }
  if (!status.ok()) return status;
  return report;
}

}  // namespace adasfm
