// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/adasfm_pipeline.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "colmap_ext/coarse/global_report.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/frames.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/host/pose_prior_table.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/georeference_file.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/mapper_stage/model_checkpoint.h"
#include "colmap_ext/scene/georeference.h"
#include "core/check_options.h"
#include "core/so3.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

constexpr char kNoPriorsWarning[] =
    "the database has no sensor priors; the model will have no metric scale "
    "(adasfm_prior_importer adds them)";

bool ChangesDatabase(const GlobalStageOptions& options) {
  return options.refinement.enabled || options.poses.camera_mount.enabled ||
         options.poses.rotation_rates.enabled || options.write_pose_priors;
}

// Who forgot a matcher would get a model of the sensors alone.
Status CheckHasMatches(const std::string& database_path,
                       const SceneData& scene) {
  const bool has_matches = std::any_of(
      scene.pairs.begin(), scene.pairs.end(),
      [](const auto& pair) { return !pair.inlier_matches.empty(); });
  if (has_matches) return Status::Ok();
  int num_matched = 0;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    CountMatches(&database, "matches", 1,
                 [&num_matched](const ImagePair&, int64_t) { ++num_matched; });
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return Status::Error(
      num_matched == 0
          ? "no images of " + database_path +
                " are matched; run a matcher of COLMAP first, such as "
                "sequential_matcher or exhaustive_matcher"
          : std::to_string(num_matched) + " pairs of " + database_path +
                " have matches, but no pair has enough verified ones; match "
                "more images, or check the camera's parameters");
}

// Of all models together.
int CountPoints(const GlobalStageResult& result) {
  int num_points = 0;
  for (const CoarseModel& model : result.models) num_points += model.num_points;
  return num_points;
}

Status CheckHasPosePriorTable(const std::string& database_path) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    if (HasPosePriorTable(&database)) return Status::Ok();
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return Status::Error(
      database_path +
      " has no table pose_priors as COLMAP 4 writes it; open the database with "
      "COLMAP 4 once, or leave --AdaSfmGlobal.write_pose_priors at 0");
}

// Before any work: nothing is lost when the result cannot be written.
Status CheckGlobalPaths(const GlobalStageOptions& options,
                        const std::string& database_path,
                        const std::string& output_path) {
  Status status = CheckDatabase(database_path);
  if (!status.ok()) return status;
  if (ChangesDatabase(options) && access(database_path.c_str(), W_OK) != 0) {
    return Status::Error("the database " + database_path +
                         " is not writable; change its permissions or use "
                         "--AdaSfmGlobal.refine_matches 0 "
                         "--AdaSfmGlobal.correct_camera_mount 0 "
                         "--AdaSfmGlobal.correct_rotation_rates 0");
  }
  if (options.write_pose_priors) status = CheckHasPosePriorTable(database_path);
  if (status.ok()) status = PrepareOutputFolder(output_path);
  return status.ok() ? CheckModelFolders(output_path) : status;
}

PriorCorrections CollectCorrections(const CoarsePoses& poses) {
  PriorCorrections corrections;
  if (poses.camera_mount.corrected) {
    corrections.camera_mount = ExpSo3(poses.camera_mount.turn_rad);
  }
  if (poses.rotation_rates.corrected) corrections.priors = poses.priors;
  return corrections;
}

// Waits for another writer, and gives up before anything is replaced.
Status CheckDatabaseIsFree(const std::string& database_path) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    return Status::Ok();
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what() +
                         "; nothing was written");
  }
}

// Beside the models, if they are somewhere on the Earth.
Status WriteGeoreferenceOf(const SceneData& scene, bool is_georeferenced,
                           const std::string& output_path) {
  RemoveGeoreference(output_path);
  if (!is_georeferenced || !scene.position_origin.has_value()) {
    return Status::Ok();
  }
  return WriteGeoreference(*scene.position_origin, output_path);
}

// Positions in one frame: those of the largest model or, georeferenced, of all.
std::vector<NewPosePrior> CollectPosePriors(const GlobalStageOptions& options,
                                            const SceneData& scene,
                                            const GlobalStageResult& result) {
  const CoarsePoses& poses = result.poses;
  const Eigen::Quaterniond camera_mount =
      poses.camera_mount.corrected ? ExpSo3(poses.camera_mount.turn_rad)
                                   : Eigen::Quaterniond::Identity();
  const double variance = options.pose_prior_sigma * options.pose_prior_sigma;
  std::vector<NewPosePrior> priors;
  for (size_t i = 0; i < result.models.size(); ++i) {
    const CoarseModel& model = result.models[i];
    if (i > 0 && !model.positions.success) continue;
    for (const auto& [image_id, pose] : CamsFromWorld(model.reconstruction)) {
      const SceneImage& image = scene.images.at(image_id);
      NewPosePrior prior;
      prior.image_id = image_id;
      prior.camera_id = image.camera_id;
      prior.position = pose.TargetOriginInSource();
      prior.covariance = variance * Eigen::Matrix3d::Identity();
      if (image.gravity_in_cam) {
        prior.gravity_in_cam = camera_mount * *image.gravity_in_cam;
      } else if (model.gravity_aligned) {
        prior.gravity_in_cam = pose.rotation * -Eigen::Vector3d::UnitZ();
      }
      priors.push_back(prior);
    }
  }
  return priors;
}

// Into a database whose COLMAP has such a table.
Status WritePosePriorsTo(const std::string& database_path,
                         const std::vector<NewPosePrior>& priors) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    WritePosePriors(priors, &database);
    transaction.Commit();
  } catch (const SqliteError& error) {
    return Status::Error("cannot write pose_priors to " + database_path + ": " +
                         error.what());
  }
  return Status::Ok();
}

// The models first: a crash in between leaves the database as it was.
Status WriteGlobalResult(const GlobalStageOptions& options,
                         const std::string& database_path,
                         const std::string& output_path, const SceneData& scene,
                         const DatabaseFrames& frames,
                         const CoarseModelReport& report) {
  const GlobalStageResult& result = report.result;
  if (ChangesDatabase(options)) {
    const Status free = CheckDatabaseIsFree(database_path);
    if (!free.ok()) return free;
  }
  // One of an earlier run would speak of other models.
  std::error_code none;
  std::filesystem::remove(output_path + "/summary.json", none);
  std::vector<const colmap::Reconstruction*> models;
  for (const CoarseModel& model : result.models) {
    models.push_back(&model.reconstruction);
  }
  Status status = WriteModelFolder(output_path, models, frames.frames);
  if (status.ok()) {
    const bool is_georeferenced = std::any_of(
        result.models.begin(), result.models.end(),
        [](const CoarseModel& model) { return model.positions.success; });
    status = WriteGeoreferenceOf(scene, is_georeferenced, output_path);
  }
  if (status.ok()) {
    status = WriteTextFile(output_path + "/removed_pairs.txt",
                           FormatRemovedPairs(scene, result));
  }
  if (status.ok() && options.write_pose_priors) {
    status = WritePosePriorsTo(database_path,
                               CollectPosePriors(options, scene, result));
  }
  if (status.ok() && ChangesDatabase(options)) {
    status = RewriteTwoViewGeometries(database_path, result.geometries,
                                      result.removed_pairs,
                                      CollectCorrections(result.poses));
  }
  return status;
}

Status CheckCoarseModel(const std::string& path) {
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = path + "/" + name;
    if (access((file + ".bin").c_str(), R_OK) != 0 &&
        access((file + ".txt").c_str(), R_OK) != 0) {
      return Status::Error("no coarse model in " + path + ": " + name +
                           ".bin is missing; run adasfm_global first");
    }
  }
  return Status::Ok();
}

// The model would replace the one that it is made from, and summary.json what
// is said about that.
Status CheckIsNotBesideInput(const std::string& input_path,
                             const std::string& output_path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path input = fs::canonical(input_path, error);
  const bool is_beside =
      !error && fs::equivalent(input.parent_path(), output_path, error);
  if (!is_beside && !fs::equivalent(input, output_path, error)) {
    return Status::Ok();
  }
  return Status::Error("the output folder " + output_path +
                       " is that of the coarse model " + input_path +
                       ", which would be replaced; choose another one");
}

// Before any work, as CheckGlobalPaths.
Status CheckMapPaths(const MapRequest& request) {
  Status status = CheckDatabase(request.database_path);
  if (status.ok()) status = CheckCoarseModel(request.input_path);
  if (status.ok()) status = PrepareOutputFolder(request.output_path);
  if (status.ok()) {
    status = CheckIsNotBesideInput(request.input_path, request.output_path);
  }
  if (status.ok()) status = CheckModelFolders(request.output_path);
  if (status.ok()) {
    status = CheckCheckpointFolder(request.output_path + "/checkpoints");
  }
  return status;
}

// Single parts may be made at the same time, each by one run.
StatusOr<std::vector<std::shared_ptr<FolderLock>>> LockMapFolder(
    const MapRequest& request) {
  using Mode = FolderLock::Mode;
  const bool is_part = request.steps == MapperSteps::kPart;
  const auto whole = FolderLock::Acquire(
      request.output_path, is_part ? Mode::kShared : Mode::kExclusive);
  if (!whole.ok()) return whole.status();
  if (!is_part) return std::vector<std::shared_ptr<FolderLock>>{*whole};
  const auto part = FolderLock::Acquire(
      request.output_path, Mode::kExclusive,
      ".adasfm_part_" + std::to_string(request.part_index) + ".lock");
  if (!part.ok()) return part.status();
  return std::vector<std::shared_ptr<FolderLock>>{*whole, *part};
}

// Poses belong to the cameras that they were adjusted with.
void TakeCameras(const colmap::Reconstruction& model, MapReport* report,
                 SceneData* scene) {
  for (const auto& [camera_id, camera] : model.Cameras()) {
    const auto given = scene->cameras.find(camera_id);
    if (given == scene->cameras.end() ||
        given->second.ModelId() != camera.ModelId() ||
        given->second.Params() == camera.Params()) {
      continue;
    }
    std::ostringstream text;
    text << "camera " << camera_id << " has the focal length "
         << camera.MeanFocalLength() << " px in the coarse model and "
         << given->second.MeanFocalLength()
         << " px in the database; the coarse model's camera is used";
    report->warnings.push_back(text.str());
    given->second.SetParams(camera.Params());
  }
}

// The poses of a coarse model, whose images must be the scene's; its cameras
// become the scene's.
StatusOr<CoarsePoseMap> ReadCoarseModel(const std::string& path,
                                        MapReport* report, SceneData* scene) {
  const StatusOr<colmap::Reconstruction> reconstruction = ReadModel(path);
  if (!reconstruction.ok()) return reconstruction.status();
  const CoarsePoseMap poses = CamsFromWorld(*reconstruction);
  for (const auto& [image_id, pose] : poses) {
    const std::string& name = reconstruction->Image(image_id).Name();
    const auto image = scene->images.find(image_id);
    if (image == scene->images.end() || image->second.name != name) {
      return Status::Error("image " + name + " of the coarse model " + path +
                           " is not in the database under its id; use the "
                           "model that adasfm_global made from it");
    }
  }
  if (poses.size() < 2) {
    return Status::Error("the coarse model " + path +
                         " has fewer than two images");
  }
  TakeCameras(*reconstruction, report, scene);
  return poses;
}

// What a stage wrote about itself; empty when it left no summary.
std::vector<std::string> ReadWarnings(const std::string& summary_path) {
  std::ifstream file(summary_path);
  const nlohmann::json json =
      nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  std::vector<std::string> warnings;
  if (!json.is_object() || !json.contains("warnings")) return warnings;
  for (const nlohmann::json& warning : json["warnings"]) {
    if (warning.is_string()) warnings.push_back(warning.get<std::string>());
  }
  return warnings;
}

std::vector<std::string> ReadEarlierWarnings(const MapRequest& request) {
  std::vector<std::string> warnings;
  // The importer's other warnings are about its input.
  for (std::string& warning :
       ReadWarnings(request.database_path + ".priors.json")) {
    if (warning.find("contradict") == std::string::npos) continue;
    warnings.push_back(std::move(warning));
  }
  for (std::string& warning :
       ReadWarnings(request.input_path + "/../summary.json")) {
    warnings.push_back(std::move(warning));
  }
  return warnings;
}

// The stage's options for this scene's cameras, with the thresholds that local
// mapping and refinement share.
MapperStageOptions ResolveOptions(const MapOptions& options,
                                  const SceneData& scene) {
  const bool is_calibrated = std::all_of(
      scene.cameras.begin(), scene.cameras.end(),
      [](const auto& entry) { return entry.second.HasPriorFocalLength(); });
  const auto resolve = [is_calibrated](int choice) {
    return choice < 0 ? !is_calibrated : choice != 0;
  };
  MapperStageOptions stage = options.stage;
  stage.refine.refine_focal_length = resolve(options.refine_focal_length);
  stage.refine.refine_extra_params = resolve(options.refine_extra_params);
  const LocalMapperOptions& local = stage.local;
  stage.refine.use_priors_in_adjustment = local.use_priors_in_adjustment;
  stage.refine.filter_max_reproj_error_px = local.filter_max_reproj_error_px;
  stage.refine.min_triangulation_angle_deg = local.min_triangulation_angle_deg;
  stage.refine.keypoint_sigma_px = local.keypoint_sigma_px;
  stage.refine.balance = local.balance;
  return stage;
}

// Moves the coarse poses into the frame of the scene's positions; positions
// that do not fit them are left out.
PositionAlignment AlignCoarseModel(MapReport* report, SceneData* scene,
                                   CoarsePoseMap* coarse) {
  PositionAlignment alignment;
  if (scene->positions.empty()) return alignment;
  const bool is_metric = std::any_of(
      scene->priors.begin(), scene->priors.end(),
      [coarse](const RelativePosePrior& prior) {
        return prior.HasLength() && coarse->count(prior.image_id1) > 0 &&
               coarse->count(prior.image_id2) > 0;
      });
  alignment = AlignSceneToPositions(*scene, *coarse, is_metric);
  if (alignment.success) {
    *coarse = TransformCamsFromWorld(alignment.enu_from_world, *coarse);
    return alignment;
  }
  report->warnings.push_back("the positions are not used: " +
                             alignment.failure);
  scene->positions.clear();
  return alignment;
}

Status MergeAndWrite(const MapRequest& request, const SceneData& scene,
                     const DatabaseFrames& frames, MapperStage* stage,
                     MapReport* report) {
  const StatusOr<colmap::Reconstruction> model =
      stage->Merge(/*require_all_parts=*/true);
  if (!model.ok()) return model.status();
  Status status =
      WriteModelFolder(request.output_path, {&*model}, frames.frames);
  if (status.ok()) {
    status = WriteGeoreferenceOf(scene, stage->Summary().is_georeferenced,
                                 request.output_path);
  }
  if (!status.ok()) return status;
  report->verdict = AssessModel(scene, stage->Summary(),
                                ReadEarlierWarnings(request), *model);
  return WriteTextFile(
      request.output_path + "/summary.json",
      FormatMapperSummaryJson(stage->Summary(), &*report->verdict));
}

Status RunMapperSteps(const MapRequest& request, const SceneData& scene,
                      const DatabaseFrames& frames, MapperStage* stage,
                      MapReport* report) {
  switch (request.steps) {
    case MapperSteps::kPlan: {
      const Status planned = stage->Plan();
      if (planned.ok()) stage->FindNumParallelParts();
      return planned;
    }
    case MapperSteps::kPart:
      return stage->RunPart(request.part_index);
    case MapperSteps::kMerge:
      return MergeAndWrite(request, scene, frames, stage, report);
    case MapperSteps::kAll:
      break;
  }
  Status status = stage->Plan();
  if (status.ok()) status = stage->RunAllParts();
  if (status.ok())
    status = MergeAndWrite(request, scene, frames, stage, report);
  return status;
}

}  // namespace

bool MapOptions::IsValid(std::string* error) const {
  const std::pair<const char*, int> choices[] = {
      {"refine_focal_length", refine_focal_length},
      {"refine_extra_params", refine_extra_params}};
  for (const auto& [name, value] : choices) {
    if (value >= -1 && value <= 1) continue;
    *error = std::string("AdaSfmMapper.") + name + " = " +
             std::to_string(value) + " must be -1, 0 or 1";
    return false;
  }
  return stage.IsValid(error);
}

StatusOr<PriorImport> ImportPriors(const PriorImportOptions& options,
                                   const PriorImportPaths& paths,
                                   const std::string& summary_path) {
  StatusOr<PriorImport> import = ComputePriorImport(paths, options);
  if (!import.ok()) return import;
  // The database comes last: an error before leaves it as it was.
  Status status =
      WriteTextFile(summary_path, PriorImportToJson(*import) + "\n");
  if (status.ok()) {
    status = WritePriorTables(paths.database_path, import->tables);
  }
  if (!status.ok()) return status;
  return import;
}

StatusOr<CoarseModelReport> EstimateCoarseModel(
    const GlobalStageOptions& options, const std::string& database_path,
    const std::string& output_path, const ProgressCallback& progress) {
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
  const auto lock =
      FolderLock::Acquire(output_path, FolderLock::Mode::kExclusive);
  if (!lock.ok()) return lock.status();

  if (progress) progress("reading", 0.0);
  SceneDataOptions scene_options;
  scene_options.read_raw_matches = options.refinement.enabled;
  scene_options.use_original_two_view_geometries = true;
  scene_options.min_num_matches = options.poses.min_num_inliers;
  const StatusOr<SceneData> scene = ReadSceneData(database_path, scene_options);
  if (!scene.ok()) return scene.status();
  const StatusOr<DatabaseFrames> frames = ReadDatabaseFrames(database_path);
  if (!frames.ok()) return frames.status();
  std::ostringstream text;
  text << scene->images.size() << " images, " << scene->pairs.size()
       << " verified pairs, " << scene->priors.size() << " priors";
  status = CheckHasMatches(database_path, *scene);
  if (!status.ok()) return status;
  const StepReport reading = {"reading", seconds(), text.str()};

  CoarseModelReport report;
  report.warnings = scene->warnings;
  if (frames->has_camera_rigs) report.warnings.push_back(kCameraRigsWarning);
  if (scene->priors.empty() && scene->positions.empty()) {
    report.warnings.push_back(kNoPriorsWarning);
  }
  StatusOr<GlobalStageResult> result =
      RunGlobalStage(options, *scene, progress);
  if (!result.ok()) return result.status();
  if (CountPoints(*result) == 0) {
    return Status::Error(
        "no point of " + database_path +
        " could be triangulated: the camera hardly moved, its parameters are "
        "wrong, or the matches are those of other images");
  }
  report.result = std::move(result).value();
  report.result.steps.insert(report.result.steps.begin(), reading);
  for (std::string& warning : ListGlobalWarnings(*scene, report.result)) {
    report.warnings.push_back(std::move(warning));
  }
  report.seconds = seconds();
  status = WriteGlobalResult(options, database_path, output_path, *scene,
                             *frames, report);
  if (!status.ok()) return status;
  report.result.steps.push_back(
      {"writing", seconds() - report.seconds, "models and matches"});
  report.seconds = seconds();
  status = WriteTextFile(
      output_path + "/summary.json",
      FormatGlobalReportJson(*scene, report.result, report.seconds));
  if (!status.ok()) return status;
  return report;
}

StatusOr<MapReport> MapParts(const MapOptions& options,
                             const MapRequest& request,
                             const ProgressCallback& progress) {
  Status status = CheckOptions(options);
  if (status.ok()) status = CheckMapPaths(request);
  if (!status.ok()) return status;
  const auto locks = LockMapFolder(request);
  if (!locks.ok()) return locks.status();
  StatusOr<SceneData> scene = ReadSceneData(request.database_path, {});
  if (!scene.ok()) return scene.status();
  status = CheckHasMatches(request.database_path, *scene);
  if (!status.ok()) return status;
  MapReport report;
  StatusOr<CoarsePoseMap> coarse =
      ReadCoarseModel(request.input_path, &report, &*scene);
  if (!coarse.ok()) return coarse.status();
  const PositionAlignment alignment =
      AlignCoarseModel(&report, &*scene, &*coarse);
  report.warnings.insert(report.warnings.begin(), scene->warnings.begin(),
                         scene->warnings.end());
  if (scene->priors.empty() && scene->positions.empty()) {
    report.warnings.push_back(kNoPriorsWarning);
  }
  const StatusOr<DatabaseFrames> frames =
      ReadDatabaseFrames(request.database_path);
  if (!frames.ok()) return frames.status();
  if (frames->has_camera_rigs) report.warnings.push_back(kCameraRigsWarning);
  MapperStageOptions stage_options = ResolveOptions(options, *scene);
  RefineModelOptions& refine = stage_options.refine;
  refine.initial_position_loss_scale =
      PositionLossScale(alignment, refine.position_loss_scale, 0, 2);
  MapperStage stage(stage_options, *scene, *coarse, request.output_path,
                    progress);
  status = RunMapperSteps(request, *scene, *frames, &stage, &report);
  if (!status.ok()) return status;
  report.summary = stage.Summary();
  return report;
}

}  // namespace adasfm
