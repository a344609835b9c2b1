// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/recording.h"

#include <filesystem>
#include <vector>

#include "colmap_ext/io/digest.h"

namespace adasfm {

StatusOr<StepInputs> DigestBag(const std::string& path,
                               const BagExtractionOptions& options) {
  namespace fs = std::filesystem;
  const fs::path bag(path);
  std::error_code error;
  std::vector<std::string> names = {bag.filename().string()};
  std::string folder = bag.parent_path().string();
  if (fs::is_directory(bag, error)) {
    const StatusOr<std::vector<std::string>> files = ListFilesRecursively(path);
    if (!files.ok()) return files.status();
    names = *files;
    folder = path;
  }
  return StepInputs{
      {"bag", DigestFiles(folder, names)},
      {"image_topic", options.topics.image},
      {"imu_topic", options.topics.imu},
      {"wheel_topic", options.topics.wheel},
      {"gnss_topic", options.topics.gnss},
      {"image_step", std::to_string(options.photos.image_step)},
      {"image_distance_m", std::to_string(options.photos.image_distance_m)},
      {"has_calibration", std::to_string(options.has_calibration)},
      {"wheel_type", options.wheel_type.has_value()
                         ? std::to_string(static_cast<int>(*options.wheel_type))
                         : "by message"}};
}

StepInputs DigestVideo(const std::string& path,
                       const VideoExtractionOptions& options) {
  const std::filesystem::path video(path);
  return {
      {"video",
       DigestFiles(video.parent_path().string(), {video.filename().string()})},
      {"video_start_ns", std::to_string(options.start_ns)},
      {"image_step", std::to_string(options.photos.image_step)},
      {"image_distance_m", std::to_string(options.photos.image_distance_m)}};
}

void UseBagFiles(const BagFiles& files, AutomaticReconstructionOptions* options,
                 AutomaticReconstructionPaths* paths) {
  const auto fill = [](const std::string& value, std::string* path) {
    if (path->empty()) *path = value;
  };
  fill(files.image_path, &paths->image_path);
  fill(files.image_times_path, &paths->image_times_path);
  fill(files.imu_path, &paths->imu_path);
  fill(files.wheel_path, &paths->wheel_path);
  fill(files.gnss_path, &paths->gnss_path);
  fill(files.sensors_path, &paths->sensors_path);
  FeatureOptions& features = options->features;
  // One topic has one camera.
  if (features.single_camera == -1) features.single_camera = 1;
  if (!features.camera_params.empty() || files.camera.params.empty()) return;
  features.camera_model = files.camera.model;
  features.camera_params = files.camera.params;
}

}  // namespace adasfm
