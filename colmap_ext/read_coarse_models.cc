// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/read_coarse_models.h"

#include <unistd.h>

#include <filesystem>
#include <sstream>
#include <utility>

#include "colmap_ext/host/model.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper_stage/split_scene.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMinImagesOfComponent = 3;

struct CoarseModelFile {
  int coarse_index = 0;
  CoarsePoseMap poses;
  std::map<camera_t, colmap::Camera> cameras;
  size_t num_points = 0;
};

std::string ModelPath(const std::string& folder, int index) {
  return folder + "/" + std::to_string(index);
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

StatusOr<CoarseModelFile> ReadCoarseModel(const std::string& path,
                                          const SceneData& scene) {
  const StatusOr<colmap::Reconstruction> reconstruction = ReadModel(path);
  if (!reconstruction.ok()) return reconstruction.status();
  CoarseModelFile model;
  model.poses = CamsFromWorld(*reconstruction);
  model.num_points = reconstruction->NumPoints3D();
  for (const auto& [camera_id, camera] : reconstruction->Cameras()) {
    model.cameras[camera_id] = camera;
  }
  for (const auto& [image_id, pose] : model.poses) {
    const std::string& name = reconstruction->Image(image_id).Name();
    const auto image = scene.images.find(image_id);
    if (image == scene.images.end() || image->second.name != name) {
      return Status::Error("image " + name + " of the coarse model " + path +
                           " is not in the database under its id; use the "
                           "model that adasfm_global made from it");
    }
  }
  if (model.poses.size() < 2) {
    return Status::Error("the coarse model " + path +
                         " has fewer than two images");
  }
  return model;
}

StatusOr<std::vector<CoarseModelFile>> ReadFiles(const std::string& input_path,
                                                 const SceneData& scene) {
  std::vector<CoarseModelFile> models;
  const bool is_folder = IsFolderOfModels(input_path);
  std::error_code error;
  for (int k = 0;
       is_folder ? fs::exists(ModelPath(input_path, k), error) : k == 0; ++k) {
    StatusOr<CoarseModelFile> model = ReadCoarseModel(
        is_folder ? ModelPath(input_path, k) : input_path, scene);
    if (!model.ok()) return model.status();
    model->coarse_index = k;
    models.push_back(std::move(*model));
  }
  return models;
}

// The models would replace the one that they are made from, and summary.json
// the summary of that.
Status CheckIsNotReplaced(const std::string& what, const std::string& path,
                          bool is_model, const std::string& output_path) {
  std::error_code error;
  const fs::path input = fs::canonical(path, error);
  const bool is_beside =
      !error && is_model &&
      fs::equivalent(input.parent_path(), output_path, error);
  if (!is_beside && !fs::equivalent(input, output_path, error)) {
    return Status::Ok();
  }
  return Status::Error("the output folder " + output_path + " is that of the " +
                       what + " " + path +
                       ", which would be replaced; choose another one");
}

bool IsLargeEnough(const CoarseModelFile& model) {
  return model.poses.size() >= kMinImagesOfComponent && model.num_points > 0;
}

// Poses are valid for the cameras that they were adjusted with. Another camera
// model is only taken where the database does not mark the camera as known.
void TakeCameras(const CoarseModelFile& model, SceneData* scene,
                 std::vector<std::string>* warnings) {
  for (const auto& [camera_id, camera] : model.cameras) {
    const auto given = scene->cameras.find(camera_id);
    if (given == scene->cameras.end()) continue;
    const bool is_same_model = ModelIdOf(given->second) == ModelIdOf(camera);
    if (is_same_model ? ParamsOf(given->second) == ParamsOf(camera)
                      : HasPriorFocalLength(given->second)) {
      continue;
    }
    std::ostringstream text;
    text << "camera " << camera_id << " has the focal length "
         << camera.MeanFocalLength() << " px in the coarse model "
         << model.coarse_index << " and " << given->second.MeanFocalLength()
         << " px in the database; the coarse model's camera is used";
    warnings->push_back(text.str());
    given->second = MakeCamera(camera_id, ModelIdOf(camera), camera.Width(),
                               camera.Height(), ParamsOf(camera),
                               HasPriorFocalLength(given->second));
  }
}

}  // namespace

bool IsFolderOfModels(const std::string& input_path) {
  return !CheckCoarseModel(input_path).ok() &&
         CheckCoarseModel(ModelPath(input_path, 0)).ok();
}

Status CheckCoarseModels(const std::string& input_path,
                         const std::string& output_path) {
  const bool is_folder = IsFolderOfModels(input_path);
  const Status status = is_folder ? Status::Ok() : CheckCoarseModel(input_path);
  if (!status.ok()) return status;
  return CheckIsNotReplaced("coarse model", input_path, !is_folder,
                            output_path);
}

Status CheckExistingModel(const std::string& path,
                          const std::string& output_path) {
  if (FindModels(path) != std::vector<std::string>{path}) {
    return Status::Error("no model in " + path);
  }
  return CheckIsNotReplaced("existing model", path, /*is_model=*/true,
                            output_path);
}

StatusOr<CoarseModels> ReadCoarseModels(const std::string& input_path,
                                        SceneData scene) {
  StatusOr<std::vector<CoarseModelFile>> files = ReadFiles(input_path, scene);
  if (!files.ok()) return files.status();
  const bool is_folder = IsFolderOfModels(input_path);
  CoarseModels models;
  std::vector<const CoarseModelFile*> large;
  for (const CoarseModelFile& file : *files) {
    if (!is_folder || IsLargeEnough(file)) large.push_back(&file);
  }
  if (large.empty()) large.push_back(&files->front());
  std::vector<CoarsePoseMap> poses;
  for (const CoarseModelFile* file : large) poses.push_back(file->poses);
  for (const CoarseModelFile& file : *files) {
    if (std::find(large.begin(), large.end(), &file) != large.end()) continue;
    for (const auto& [image_id, pose] : file.poses) {
      models.images_of_small_components.insert(image_id);
    }
  }
  models.warnings = scene.warnings;
  SplitSceneData split = SplitScene(poses, std::move(scene));
  models.rest = std::move(split.rest);
  for (size_t k = 0; k < large.size(); ++k) {
    TakeCameras(*large[k], &split.components[k], &models.warnings);
    ComponentToMap component;
    component.coarse_index = large[k]->coarse_index;
    component.coarse = std::move(poses[k]);
    component.data = std::move(split.components[k]);
    models.components.push_back(std::move(component));
  }
  return models;
}

}  // namespace adasfm
