// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/rig_frames.h"

#include <algorithm>
#include <set>

#include "colmap_ext/priors/stamp_images.h"
#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Triggers and clocks of one rig differ by less.
constexpr timestamp_t kMaxFrameNs = 1'000'000;

// The number k of a folder camK in the name; -1 without such a folder.
int CameraIndexOfName(const std::string& name) {
  size_t begin = 0;
  for (size_t end = name.find('/'); end != std::string::npos;
       begin = end + 1, end = name.find('/', begin)) {
    const std::string folder = name.substr(begin, end - begin);
    if (folder.size() < 4 || folder.size() > 5 ||
        folder.compare(0, 3, "cam") != 0) {
      continue;
    }
    const std::string digits = folder.substr(3);
    if (std::all_of(digits.begin(), digits.end(),
                    [](char c) { return c >= '0' && c <= '9'; })) {
      return std::stoi(digits);
    }
  }
  return -1;
}

// The ids of the database's cameras by their number in the calibration.
StatusOr<std::map<int, camera_t>> FindCameraIds(
    size_t num_cameras, const SceneData& scene,
    std::vector<std::string>* warnings) {
  std::map<int, camera_t> ids;
  std::set<camera_t> used;
  for (const auto& [image_id, image] : scene.images) {
    used.insert(image.camera_id);
  }
  const bool have_folders = std::all_of(
      scene.images.begin(), scene.images.end(), [&](const auto& entry) {
        const int index = CameraIndexOfName(entry.second.name);
        return index >= 0 && index < static_cast<int>(num_cameras);
      });
  if (!have_folders) {
    if (used.size() == num_cameras) {
      for (const camera_t camera_id : used) ids.emplace(ids.size(), camera_id);
    } else if (used.size() > 1) {
      warnings->push_back(
          "the calibration has " + std::to_string(num_cameras) +
          " cameras and the database " + std::to_string(used.size()) +
          ", so its images are not taken for those of a rig; put them into "
          "folders cam0, cam1, ...");
    }
    return ids;
  }
  std::map<camera_t, int> indices;
  for (const auto& [image_id, image] : scene.images) {
    const int index = CameraIndexOfName(image.name);
    const camera_t camera_id =
        ids.emplace(index, image.camera_id).first->second;
    if (camera_id != image.camera_id ||
        indices.emplace(camera_id, index).first->second != index) {
      return Status::Error(
          "the images of each folder cam0, cam1, ... must have one camera of "
          "the database and share it with no other folder (image " +
          image.name +
          "); extract with --ImageReader.single_camera_per_folder 1");
    }
  }
  return ids;
}

}  // namespace

bool RigOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmRig", error)
      .Positive({{"rotation_sigma_deg", rotation_sigma_deg},
                 {"translation_sigma_m", translation_sigma_m}})
      .AllHold();
}

StatusOr<std::map<camera_t, RigCamera>> FindRigCameras(
    const RigOptions& options, const SceneData& scene,
    SensorCalibration* calibration, std::vector<std::string>* warnings) {
  std::map<camera_t, RigCamera> cameras;
  std::vector<Rigid3d> cams_from_imu = {calibration->cam_from_imu};
  cams_from_imu.insert(cams_from_imu.end(),
                       calibration->other_cams_from_imu.begin(),
                       calibration->other_cams_from_imu.end());
  if (cams_from_imu.size() < 2) return cameras;
  const StatusOr<std::map<int, camera_t>> ids =
      FindCameraIds(cams_from_imu.size(), scene, warnings);
  if (!ids.ok()) return ids.status();
  if (ids->size() < 2) return cameras;
  int reference = ids->begin()->first;
  for (const auto& [index, camera_id] : *ids) {
    const auto of_host = scene.rigs.cameras.find(camera_id);
    if (of_host != scene.rigs.cameras.end() && of_host->second.is_reference) {
      reference = index;
    }
  }
  for (const auto& [index, camera_id] : *ids) {
    RigCamera camera;
    camera.rig_id = ids->at(reference);
    camera.is_reference = index == reference;
    camera.cam_from_rig =
        camera.is_reference
            ? Rigid3d()
            : cams_from_imu[index] * cams_from_imu[reference].Inverse();
    camera.rotation_sigma_rad = DegToRad(options.rotation_sigma_deg);
    camera.translation_sigma_m = options.translation_sigma_m;
    cameras[camera_id] = camera;
  }
  calibration->cam_from_imu = cams_from_imu[reference];
  return cameras;
}

std::vector<ImageStamp> GroupFrames(
    const SceneData& scene, const std::map<camera_t, RigCamera>& cameras,
    std::vector<ImageStamp>* stamps) {
  const auto rig_camera = [&](const ImageStamp& stamp) -> const RigCamera* {
    const auto it = cameras.find(scene.images.at(stamp.image_id).camera_id);
    return it == cameras.end() ? nullptr : &it->second;
  };
  for (size_t begin = 0; begin < stamps->size();) {
    const timestamp_t first_ns = (*stamps)[begin].timestamp_ns;
    timestamp_t frame_ns = first_ns;
    std::set<camera_t> seen;
    std::vector<ImageStamp*> frame;
    size_t end = begin;
    for (; end < stamps->size(); ++end) {
      ImageStamp& stamp = (*stamps)[end];
      if (stamp.timestamp_ns - first_ns > kMaxFrameNs) break;
      const RigCamera* camera = rig_camera(stamp);
      if (camera == nullptr) continue;
      if (!seen.insert(scene.images.at(stamp.image_id).camera_id).second) break;
      if (camera->is_reference) frame_ns = stamp.timestamp_ns;
      frame.push_back(&stamp);
    }
    for (ImageStamp* stamp : frame) stamp->timestamp_ns = frame_ns;
    begin = std::max(end, begin + 1);
  }
  SortByTime(stamps);
  if (cameras.empty()) return *stamps;
  std::vector<ImageStamp> references;
  for (const ImageStamp& stamp : *stamps) {
    const RigCamera* camera = rig_camera(stamp);
    if (camera != nullptr && camera->is_reference) references.push_back(stamp);
  }
  return references;
}

}  // namespace adasfm
