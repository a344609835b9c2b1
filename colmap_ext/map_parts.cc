// SPDX-License-Identifier: BSD-3-Clause
// Stage 3 of adasfm_pipeline.h.
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/check_scene.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/frames.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/georeference_file.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/mapper_stage/existing_model.h"
#include "colmap_ext/mapper_stage/leftover_components.h"
#include "colmap_ext/mapper_stage/lost_images.h"
#include "colmap_ext/mapper_stage/map_components.h"
#include "colmap_ext/read_coarse_models.h"
#include "colmap_ext/scene/georeference.h"
#include "colmap_ext/stage_memory.h"
#include "core/check_options.h"
#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

// Before any work: nothing is lost when the result cannot be written.
Status CheckMapPaths(const MapRequest& request) {
  Status status = CheckDatabase(request.database_path);
  if (status.ok()) status = PrepareOutputFolder(request.output_path);
  if (status.ok()) {
    status = CheckCoarseModels(request.input_path, request.output_path);
  }
  if (status.ok() && !request.existing_path.empty()) {
    status = CheckExistingModel(request.existing_path, request.output_path);
  }
  if (status.ok()) status = CheckModelFolders(request.output_path);
  if (status.ok()) status = CheckComponentCheckpoints(request.output_path);
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

Status CheckMergeMemory(const MapOptions& options, const MapRequest& request,
                        std::vector<std::string>* warnings) {
  if (request.steps != MapperSteps::kAll &&
      request.steps != MapperSteps::kMerge) {
    return Status::Ok();
  }
  const StatusOr<SceneSize> size = MeasureScene(request.database_path);
  if (!size.ok()) return size.status();
  return CheckMemory(EstimateStageMemoryBytes(*size),
                     options.stage.max_memory_gb, "AdaSfmMapper.max_memory_gb",
                     warnings);
}

// Reads the summary that a stage wrote; no JSON object when there is none.
nlohmann::json ReadSummary(const std::string& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
}

std::string ImportSummaryPath(const MapRequest& request) {
  return request.database_path + ".priors.json";
}

std::vector<std::string> ReadWarnings(const std::string& summary_path) {
  const nlohmann::json json = ReadSummary(summary_path);
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
  for (std::string& warning : ReadWarnings(ImportSummaryPath(request))) {
    if (warning.find("contradict") == std::string::npos) continue;
    warnings.push_back(std::move(warning));
  }
  const std::string folder = IsFolderOfModels(request.input_path)
                                 ? request.input_path
                                 : request.input_path + "/..";
  for (std::string& warning : ReadWarnings(folder + "/summary.json")) {
    warnings.push_back(std::move(warning));
  }
  return warnings;
}

// The stage's options for this scene's cameras.
MapperStageOptions ResolveOptions(const MapOptions& options,
                                  const SceneData& scene) {
  std::set<camera_t> calibrated;
  for (const auto& [camera_id, camera] : scene.cameras) {
    if (HasPriorFocalLength(camera)) calibrated.insert(camera_id);
  }
  const bool is_calibrated = calibrated.size() == scene.cameras.size();
  const auto resolve = [is_calibrated](int choice) {
    return choice < 0 ? !is_calibrated : choice != 0;
  };
  MapperStageOptions stage = options.stage;
  const bool is_asked_for = options.refine_focal_length > 0 ||
                            options.refine_extra_params > 0 ||
                            stage.refine.refine_principal_point;
  if (!is_calibrated && !is_asked_for) {
    stage.refine.constant_cameras = std::move(calibrated);
  }
  stage.refine.refine_focal_length = resolve(options.refine_focal_length);
  stage.refine.refine_extra_params = resolve(options.refine_extra_params);
  return stage;
}

// Images with verified matches, including those that adasfm_global removed.
StatusOr<std::set<image_t>> FindMatchedImages(
    const std::string& database_path) {
  std::set<image_t> images;
  const auto add = [&images](const ImagePair& pair, int64_t) {
    images.insert(pair.image_id1);
    images.insert(pair.image_id2);
  };
  const int min_num_matches = SceneDataOptions().min_num_matches;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    for (const char* table :
         {"two_view_geometries", kTwoViewGeometryBackupTable}) {
      if (!database.HasTable(table)) continue;
      CountMatches(&database, table, min_num_matches, add);
    }
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return images;
}

StatusOr<std::vector<LostImage>> FindLost(
    const MapRequest& request, const CoarseModels& coarse,
    const std::vector<MappedComponent>& mapped) {
  const StatusOr<std::set<image_t>> matched =
      FindMatchedImages(request.database_path);
  if (!matched.ok()) return matched.status();
  std::set<image_t> images;
  for (const MappedComponent& component : mapped) {
    const std::vector<image_t> ids = component.model.RegImageIds();
    images.insert(ids.begin(), ids.end());
  }
  return FindLostImages(coarse.components, coarse.rest,
                        coarse.images_of_small_components, *matched, images);
}

Verdict Assess(const MapRequest& request, const CoarseModels& coarse,
               const std::vector<MappedComponent>& mapped,
               std::vector<LostImage> lost) {
  std::vector<AssessedModel> assessed;
  for (const MappedComponent& component : mapped) {
    assessed.push_back({&coarse.components[component.component].data,
                        &component.summary, &component.model});
  }
  Verdict verdict =
      AssessModels(assessed, coarse.rest, ReadEarlierWarnings(request));
  verdict.lost_images = std::move(lost);
  return verdict;
}

Status ReadExistingModel(const std::string& path, MapperStageOptions* options,
                         CoarseModels* coarse) {
  const StatusOr<colmap::Reconstruction> existing = ReadModel(path);
  if (!existing.ok()) return existing.status();
  return UseExistingModel(*existing, &coarse->components,
                          &options->refine.constant_cameras, &coarse->warnings);
}

// Moves the coarse poses into the frame of the scene's positions; removes the
// positions if that fails.
void AlignCoarseModel(ComponentToMap* component,
                      std::vector<std::string>* warnings) {
  SceneData& data = component->data;
  if (data.positions.empty()) return;
  const CoarsePoseMap& coarse = component->coarse;
  const PositionAlignment alignment =
      AlignSceneToPositions(data, coarse, HasMetricPriors(data, coarse));
  component->initial_position_loss_scale = PositionLossScale(
      alignment, PriorBundleAdjustmentOptions().position_loss_scale, 0, 2);
  if (alignment.success) {
    component->coarse =
        TransformCamsFromWorld(alignment.enu_from_world, coarse);
    return;
  }
  warnings->push_back("the positions are not used for coarse model " +
                      std::to_string(component->coarse_index) + ": " +
                      alignment.failure);
  data.positions.clear();
}

// Sets the priors within frames. Unknown relative poses of cameras come from
// the coarse model; priors on these measure no metres.
void CompleteRigs(const CoarsePoseMap& coarse, SceneData* data) {
  const CameraRigs known = data->rigs;
  EstimateUnknownRigCameras(coarse, &data->rigs);
  data->frame_priors = ComputeFramePriors(data->rigs);
  const auto is_known = [&known](image_t image_id) {
    return known.cameras.at(known.images.at(image_id).camera_id)
        .cam_from_rig.has_value();
  };
  for (RelativePosePrior& prior : data->frame_priors) {
    if (is_known(prior.image_id1) && is_known(prior.image_id2)) continue;
    prior.flags &= ~kPriorLength;
  }
}

Status AssessAndWrite(const MapRequest& request, const CoarseModels& coarse,
                      const std::vector<MappedComponent>& mapped,
                      const ModelFrames& frames, MapReport* report) {
  std::vector<const colmap::Reconstruction*> models;
  for (const MappedComponent& component : mapped) {
    if (component.model.NumRegImages() == 0) continue;
    models.push_back(&component.model);
    const ComponentToMap& source = coarse.components[component.component];
    report->models.push_back(
        {source.coarse_index, component.summary,
         AssessModel(source.data, component.summary, {}, component.model)});
  }
  StatusOr<std::vector<LostImage>> lost = FindLost(request, coarse, mapped);
  if (!lost.ok()) return lost.status();
  report->verdict = Assess(request, coarse, mapped, std::move(*lost));
  Status status = WriteModelFolder(request.output_path, models, frames);
  if (status.ok()) {
    const bool is_georeferenced = std::any_of(
        mapped.begin(), mapped.end(), [](const MappedComponent& component) {
          return component.summary.is_georeferenced;
        });
    status = UpdateGeoreference(
        is_georeferenced,
        coarse.components[mapped.front().component].data.position_origin,
        request.output_path);
  }
  if (status.ok()) {
    status = WriteTextFile(request.output_path + "/summary.json",
                           FormatMappingJson(report->models, *report->verdict));
  }
  if (!status.ok()) return status;
  return RemoveSurplusCheckpoints(request.output_path,
                                  coarse.components.size());
}

// Maps the images that the models left out, also when the parts were mapped by
// other calls.
Status MapLeftovers(const MapperStageOptions& options,
                    const MapRequest& request, const MapperProgress& progress,
                    CoarseModels* coarse,
                    std::vector<MappedComponent>* mapped) {
  const size_t num_components = coarse->components.size();
  TakeLeftovers(*mapped, &coarse->components);
  if (coarse->components.size() == num_components) return Status::Ok();
  size_t num_images = 0;
  for (size_t k = num_components; k < coarse->components.size(); ++k) {
    num_images += coarse->components[k].coarse.size();
  }
  if (progress) {
    progress(std::to_string(num_images) +
                 " images that hold together are left out: mapping them by "
                 "themselves",
             0.0);
  }
  StatusOr<std::vector<MappedComponent>> found = MapComponents(
      options, coarse->components, num_components, request.output_path,
      MapperSteps::kAll, request.part_index, progress);
  if (!found.ok()) return found.status();
  std::move(found->begin(), found->end(), std::back_inserter(*mapped));
  return Status::Ok();
}

// Most images first; an error when there are none.
Status SortBySize(std::vector<MappedComponent>* mapped) {
  std::stable_sort(mapped->begin(), mapped->end(),
                   [](const MappedComponent& a, const MappedComponent& b) {
                     return a.model.NumRegImages() > b.model.NumRegImages();
                   });
  if (mapped->front().model.NumRegImages() > 0) return Status::Ok();
  return Status::Error(
      "no image could be reconstructed; does the coarse model at "
      "--input_path belong to this database?");
}

}  // namespace

bool MapOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmMapper", error)
             .Require(std::abs(refine_focal_length) <= 1, "refine_focal_length",
                      refine_focal_length, "must be -1, 0 or 1")
             .Require(std::abs(refine_extra_params) <= 1, "refine_extra_params",
                      refine_extra_params, "must be -1, 0 or 1")
             .AllHold() &&
         stage.IsValid(error);
}

StatusOr<MapReport> MapParts(const MapOptions& options,
                             const MapRequest& request,
                             const ProgressCallback& progress) {
  const OneOpenMpThread one_thread;
  Status status = CheckOptions(options);
  if (status.ok()) status = CheckMapPaths(request);
  if (!status.ok()) return status;
  MapReport report;
  status = CheckMergeMemory(options, request, &report.warnings);
  if (!status.ok()) return status;
  const auto locks = LockMapFolder(request);
  if (!locks.ok()) return locks.status();
  StatusOr<SceneData> scene = ReadSceneData(request.database_path, {});
  if (!scene.ok()) return scene.status();
  status = CheckHasMatches(request.database_path, *scene);
  if (!status.ok()) return status;
  MapperStageOptions stage_options = ResolveOptions(options, *scene);
  const bool has_priors = !scene->priors.empty() || !scene->positions.empty() ||
                          !scene->frame_priors.empty();
  std::vector<std::string> frame_warnings;
  const StatusOr<ModelFrames> frames =
      ReadModelFrames(request.database_path, *scene, &frame_warnings);
  if (!frames.ok()) return frames.status();
  StatusOr<CoarseModels> coarse =
      ReadCoarseModels(request.input_path, std::move(*scene));
  if (!coarse.ok()) return coarse.status();
  if (!request.existing_path.empty()) {
    status = ReadExistingModel(request.existing_path, &stage_options, &*coarse);
    if (!status.ok()) return status;
  }
  for (ComponentToMap& component : coarse->components) {
    CompleteRigs(component.coarse, &component.data);
    AlignCoarseModel(&component, &coarse->warnings);
  }
  report.warnings.insert(report.warnings.end(), coarse->warnings.begin(),
                         coarse->warnings.end());
  if (!has_priors) report.warnings.push_back(kNoPriorsWarning);
  report.warnings.insert(report.warnings.end(), frame_warnings.begin(),
                         frame_warnings.end());
  StatusOr<std::vector<MappedComponent>> mapped =
      MapComponents(stage_options, coarse->components, 0, request.output_path,
                    request.steps, request.part_index, progress);
  if (!mapped.ok()) return mapped.status();
  if (mapped->empty()) return report;
  status = MapLeftovers(stage_options, request, progress, &*coarse, &*mapped);
  if (status.ok()) status = SortBySize(&*mapped);
  if (!status.ok()) return status;
  status = AssessAndWrite(request, *coarse, *mapped, *frames, &report);
  if (!status.ok()) return status;
  return report;
}

}  // namespace adasfm
