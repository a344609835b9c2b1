// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/prepare_reconstruction.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>

#include "colmap_ext/datasets/calibrated_camera.h"
#include "colmap_ext/datasets/dataset_layout.h"
#include "colmap_ext/io/output_files.h"

namespace adasfm {
namespace {

// Writes a file unless it already has this text.
Status WriteIfChanged(const std::string& path, const std::string& text) {
  std::ostringstream old;
  old << std::ifstream(path, std::ios::binary).rdbuf();
  return old.str() == text ? Status::Ok() : WriteTextFile(path, text);
}

bool HasSensors(const AutomaticReconstructionPaths& paths) {
  return !paths.imu_path.empty() || !paths.wheel_path.empty();
}

Status ApplyLayout(AutomaticReconstructionOptions* options,
                   AutomaticReconstructionPaths* paths) {
  const StatusOr<DatasetLayout> layout =
      FindDatasetLayout(paths->data_format, paths->image_path);
  if (!layout.ok()) return layout.status();
  paths->image_path = layout->image_path;
  FeatureOptions& features = options->features;
  if (features.camera_params.empty() && !layout->camera_params.empty()) {
    features.camera_model = layout->camera_model;
    features.camera_params = layout->camera_params;
  }
  // A recording has one camera.
  if (features.single_camera == -1) features.single_camera = 1;
  if (paths->imu_path.empty()) paths->imu_path = layout->imu_path;
  if (paths->image_times_path.empty()) {
    paths->image_times_path = layout->image_times_path;
  }
  // A gap of a log of 200 Hz may be a normal period of a log of 10 Hz.
  double& max_gap_s = options->priors.estimation.links.max_imu_gap_s;
  max_gap_s = std::max(max_gap_s, 2.5 * layout->imu_period_s);
  const auto write = [paths](const std::string& name, const std::string& text,
                             std::string* path) {
    if (!path->empty() || text.empty()) return Status::Ok();
    *path = paths->workspace_path + "/" + name;
    return WriteIfChanged(*path, text);
  };
  const Status status = write("image_times.csv", layout->image_times_text,
                              &paths->image_times_path);
  if (!status.ok() || !HasSensors(*paths)) return status;
  return write("sensors.yaml", layout->sensors_text, &paths->sensors_path);
}

// Uses the camera of the sensors' calibration, unless the user gave one.
Status UseSensorsCamera(const std::string& sensors_path,
                        FeatureOptions* features) {
  if (sensors_path.empty() || !features->camera_params.empty() ||
      features->camera_model != FeatureOptions().camera_model) {
    return Status::Ok();
  }
  const StatusOr<std::optional<CalibratedCamera>> read =
      ReadSensorsCamera(sensors_path);
  if (!read.ok()) return read.status();
  const std::optional<CalibratedCamera>& camera = *read;
  if (!camera) return Status::Ok();
  features->camera_model = camera->model;
  features->camera_params = camera->params;
  features->camera_width_px = camera->width_px;
  features->camera_height_px = camera->height_px;
  return Status::Ok();
}

}  // namespace

Status PrepareReconstruction(AutomaticReconstructionOptions* options,
                             AutomaticReconstructionPaths* paths) {
  if (!paths->data_format.empty()) {
    const Status status = ApplyLayout(options, paths);
    if (!status.ok()) return status;
  }
  std::error_code none;
  if (std::filesystem::equivalent(paths->image_path, paths->workspace_path,
                                  none)) {
    return Status::Error("the workspace " + paths->workspace_path +
                         " is the folder of the photos; choose another one");
  }
  if (HasSensors(*paths) && paths->sensors_path.empty()) {
    return Status::Error(
        "sensor logs need the calibration of the sensors; give --sensors_path");
  }
  const Status camera_status =
      UseSensorsCamera(paths->sensors_path, &options->features);
  if (!camera_status.ok()) return camera_status;
  options->pairs.image_times_path = paths->image_times_path;
  options->priors.max_memory_gb = options->max_memory_gb;
  options->global.max_memory_gb = options->max_memory_gb;
  options->map.stage.max_memory_gb = options->max_memory_gb;
  options->features.num_threads = options->num_threads;
  options->pairs.num_threads = options->num_threads;
  options->global.num_threads = options->num_threads;
  options->map.stage.num_threads = options->num_threads;
  // EXIF's focal length may be wrong by a third, and EXIF has no distortion. A
  // given calibration is not changed.
  const bool refine = options->refine_intrinsics < 0
                          ? options->features.camera_params.empty()
                          : options->refine_intrinsics == 1;
  options->map.refine_focal_length = refine;
  options->map.refine_extra_params = refine;
  // With wrong intrinsics, the epipolar distances would remove most of the good
  // matches.
  options->global.refinement.enabled = !refine;
  return Status::Ok();
}

}  // namespace adasfm
