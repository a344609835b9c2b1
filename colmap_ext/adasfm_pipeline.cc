// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/adasfm_pipeline.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <utility>

#include "colmap_ext/check_scene.h"
#include "colmap_ext/coarse/global_report.h"
#include "colmap_ext/coarse/global_warnings.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/frames.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/host/pose_prior_table.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/georeference_file.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/scene/drives.h"
#include "colmap_ext/stage_memory.h"
#include "core/check_options.h"
#include "core/parallel.h"
#include "core/so3.h"
#include "core/sqlite.h"
#include "core/stopwatch.h"

namespace adasfm {
namespace {

bool ChangesDatabase(const GlobalStageOptions& options) {
  return options.refinement.enabled ||
         options.poses.camera_imu_rotation.enabled || options.write_pose_priors;
}

// Points of all models together.
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
                         "--AdaSfmGlobal.correct_camera_imu_rotation 0");
  }
  if (options.write_pose_priors) status = CheckHasPosePriorTable(database_path);
  if (status.ok()) status = PrepareOutputFolder(output_path);
  return status.ok() ? CheckModelFolders(output_path) : status;
}

// Waits for another writer; an error before anything is replaced.
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

// Positions in one frame: those of the largest model or, georeferenced, of all.
std::vector<NewPosePrior> CollectPosePriors(const GlobalStageOptions& options,
                                            const SceneData& scene,
                                            const GlobalStageResult& result) {
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
        prior.gravity_in_cam = image.gravity_in_cam;
      } else if (model.gravity_aligned) {
        prior.gravity_in_cam = pose.rotation * -Eigen::Vector3d::UnitZ();
      }
      priors.push_back(prior);
    }
  }
  return priors;
}

// Writes to a database with COLMAP 4's table.
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
                         const ModelFrames& frames,
                         const CoarseModelReport& report) {
  const GlobalStageResult& result = report.result;
  if (ChangesDatabase(options)) {
    const Status free = CheckDatabaseIsFree(database_path);
    if (!free.ok()) return free;
  }
  // The summary of an earlier run would describe other models.
  std::error_code none;
  std::filesystem::remove(output_path + "/summary.json", none);
  std::vector<const colmap::Reconstruction*> models;
  for (const CoarseModel& model : result.models) {
    models.push_back(&model.reconstruction);
  }
  Status status = WriteModelFolder(output_path, models, frames);
  if (status.ok()) {
    const bool is_georeferenced = std::any_of(
        result.models.begin(), result.models.end(),
        [](const CoarseModel& model) { return model.positions.success; });
    status = UpdateGeoreference(is_georeferenced, scene.position_origin,
                                output_path);
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
    PriorCorrections corrections;
    corrections.camera_imu = CorrectionsByCamera(
        scene, CameraImuCorrections(result.poses.camera_imu_rotations));
    corrections.time_shift_s = CorrectionsByCamera(scene, result.time_shifts);
    corrections.gyroscope_scales =
        CorrectionsByCamera(scene, result.gyroscope_scales);
    corrections.lengths = result.inertial_lengths;
    status = RewriteTwoViewGeometries(database_path, result.geometries,
                                      result.removed_pairs, corrections);
  }
  return status;
}

// Raw matches, which only their refinement reads, stay in the database until
// then.
StatusOr<GlobalStageResult> RunStage(const GlobalStageOptions& options,
                                     const std::string& database_path,
                                     SceneData* scene,
                                     const ProgressCallback& progress) {
  if (!options.refinement.enabled) {
    return RunGlobalStage(options, scene, progress);
  }
  StatusOr<RawMatchSource> raw_matches = OpenRawMatches(database_path, *scene);
  if (!raw_matches.ok()) return raw_matches.status();
  try {
    return RunGlobalStage(options, scene, progress, std::move(*raw_matches));
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
}

}  // namespace

StatusOr<PriorImport> ImportPriors(const PriorImportOptions& options,
                                   const PriorImportPaths& paths,
                                   const std::string& summary_path) {
  std::vector<std::string> warnings;
  Status status =
      CheckMemory(EstimateImportMemoryBytes(paths), options.max_memory_gb,
                  "AdaSfmPriors.max_memory_gb", &warnings);
  if (!status.ok()) return status;
  StatusOr<PriorImport> import = ComputePriorImport(paths, options);
  if (!import.ok()) return import;
  import->warnings.insert(import->warnings.begin(), warnings.begin(),
                          warnings.end());
  // The database comes last: an error before leaves it as it was.
  status = WriteTextFile(summary_path, PriorImportToJson(*import) + "\n");
  if (status.ok()) {
    status = WritePriorTables(paths.database_path, import->tables);
  }
  if (!status.ok()) return status;
  return import;
}

StatusOr<CoarseModelReport> EstimateCoarseModel(
    const GlobalStageOptions& options, const std::string& database_path,
    const std::string& output_path, const ProgressCallback& progress) {
  const OneOpenMpThread one_thread;
  const Stopwatch watch;
  Status status = CheckOptions(options);
  if (status.ok()) {
    status = CheckGlobalPaths(options, database_path, output_path);
  }
  if (!status.ok()) return status;
  CoarseModelReport report;
  const StatusOr<SceneSize> size = MeasureScene(database_path);
  if (!size.ok()) return size.status();
  status = CheckMemory(EstimateStageMemoryBytes(*size), options.max_memory_gb,
                       "AdaSfmGlobal.max_memory_gb", &report.warnings);
  if (!status.ok()) return status;
  const auto lock =
      FolderLock::Acquire(output_path, FolderLock::Mode::kExclusive);
  if (!lock.ok()) return lock.status();

  if (progress) progress("reading", 0.0);
  SceneDataOptions scene_options;
  scene_options.use_original_two_view_geometries = true;
  scene_options.min_num_matches = options.poses.min_num_inliers;
  StatusOr<SceneData> scene = ReadSceneData(database_path, scene_options);
  if (!scene.ok()) return scene.status();
  // Metres by the accelerometer reach the mapper through the database only.
  if (!ChangesDatabase(options)) scene->inertial_motions.clear();
  std::ostringstream text;
  text << scene->images.size() << " images, " << scene->pairs.size()
       << " verified pairs, " << scene->priors.size() << " priors";
  status = CheckHasMatches(database_path, *scene);
  if (!status.ok()) return status;
  const CoarseStep reading = {"reading", watch.Seconds(), text.str()};

  report.warnings.insert(report.warnings.end(), scene->warnings.begin(),
                         scene->warnings.end());
  const StatusOr<ModelFrames> frames =
      ReadModelFrames(database_path, *scene, &report.warnings);
  if (!frames.ok()) return frames.status();
  if (scene->priors.empty() && scene->positions.empty() &&
      scene->frame_priors.empty()) {
    report.warnings.push_back(kNoPriorsWarning);
  }
  StatusOr<GlobalStageResult> result =
      RunStage(options, database_path, &*scene, progress);
  if (!result.ok()) return result.status();
  if (CountPoints(*result) == 0) {
    return Status::Error(
        "no point of " + database_path +
        " could be triangulated: the camera hardly moved, its parameters are "
        "wrong, or the matches are those of other images");
  }
  report.result = std::move(result).value();
  for (const CalibratedFocalLength& found : report.result.focal_lengths) {
    report.warnings.push_back(DescribeFocalLength(found));
  }
  report.result.steps.insert(report.result.steps.begin(), reading);
  for (std::string& warning : ListGlobalWarnings(*scene, report.result)) {
    report.warnings.push_back(std::move(warning));
  }
  report.seconds = watch.Seconds();
  status = WriteGlobalResult(options, database_path, output_path, *scene,
                             *frames, report);
  if (!status.ok()) return status;
  report.result.steps.push_back(
      {"writing", watch.Seconds() - report.seconds, "models and matches"});
  report.seconds = watch.Seconds();
  status = WriteTextFile(
      output_path + "/summary.json",
      FormatGlobalReportJson(*scene, report.result, report.seconds));
  if (!status.ok()) return status;
  return report;
}

}  // namespace adasfm
