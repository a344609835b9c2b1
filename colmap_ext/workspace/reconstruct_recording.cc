// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <functional>

#include "colmap_ext/bags/extract_video.h"
#include "colmap_ext/io/digest.h"
#include "colmap_ext/workspace/open_workspace.h"
#include "colmap_ext/workspace/reconstructor.h"
#include "colmap_ext/workspace/recording.h"
#include "sensors/io/calibration.h"

namespace adasfm {

Status Reconstructor::Bag() {
  BagExtractionOptions& bag = options_.bag;
  bag.has_calibration = !paths_.sensors_path.empty();
  if (bag.has_calibration) {
    const StatusOr<SensorCalibration> calibration =
        ReadSensorCalibration(paths_.sensors_path);
    if (!calibration.ok()) return calibration.status();
    if (calibration->has_wheel) bag.wheel_type = calibration->wheel_type;
  }
  StatusOr<StepInputs> inputs = DigestBag(paths_.bag_path, bag);
  if (!inputs.ok()) return inputs.status();
  return RunExtraction(*inputs, [&](const std::string& folder) {
    return ExtractBag(paths_.bag_path, bag, folder, ProgressIn(kBag, "bag"));
  });
}

Status Reconstructor::Video() {
  if (!std::filesystem::is_regular_file(paths_.video_path)) {
    return Status::Error("the video " + paths_.video_path + " is not there");
  }
  VideoExtractionOptions video;
  video.photos = options_.bag.photos;
  video.start_ns = options_.video_start_ns;
  video.wheel_path = paths_.wheel_path;
  StepInputs inputs = DigestVideo(paths_.video_path, video);
  if (video.photos.image_distance_m > 0.0) {
    const StatusOr<StepInputs> wheel =
        DigestPaths({{"wheel", paths_.wheel_path}});
    if (!wheel.ok()) return wheel.status();
    inputs.insert(wheel->begin(), wheel->end());
  }
  return RunExtraction(inputs, [&](const std::string& folder) {
    return ExtractVideo(paths_.video_path, video, folder,
                        InWorkspace("logs/video.log"),
                        ProgressIn(kBag, "video"));
  });
}

Status Reconstructor::RunExtraction(
    const StepInputs& inputs,
    const std::function<StatusOr<BagExtraction>(const std::string&)>& extract) {
  const std::string folder = BagFolder(paths_.workspace_path);
  const auto reset = [&folder] { return RemoveBagFiles(folder); };
  const auto work = [&]() -> Status {
    const StatusOr<BagExtraction> extraction = extract(folder);
    if (!extraction.ok()) return extraction.status();
    Warn(extraction->warnings);
    message_(extraction->summary);
    return Status::Ok();
  };
  const auto check = [&folder] {
    const BagFiles files = FindBagFiles(folder);
    return files.image_path.empty() || files.image_times_path.empty()
               ? Status::Error("there are no photos in " + folder)
               : Status::Ok();
  };
  const Status status = RunStep(kBagStep, inputs, {reset, work, check});
  if (status.ok()) UseBagFiles(FindBagFiles(folder), &options_, &paths_);
  return status;
}

}  // namespace adasfm
