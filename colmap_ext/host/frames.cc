// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/frames.h"

#include <fstream>
#include <set>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

// COLMAP's number of the sensor type.
constexpr int32_t kCamera = 0;

template <typename T>
void Write(T value, std::ostream* file) {
  file->write(reinterpret_cast<const char*>(&value), sizeof(value));
}

void WritePose(const Rigid3d& pose, std::ostream* file) {
  const Eigen::Quaterniond& rotation = pose.rotation;
  for (const double value :
       {rotation.w(), rotation.x(), rotation.y(), rotation.z()}) {
    Write<double>(value, file);
  }
  for (int i = 0; i < 3; ++i) Write<double>(pose.translation(i), file);
}

// The cameras of the rigs that have more than a reference camera.
CameraRigs ReadRigs(SqliteConnection* database) {
  CameraRigs rigs;
  SqliteStatement others(
      database,
      "SELECT rig_id, sensor_id, sensor_from_rig, ref_sensor_id "
      "FROM rig_sensors JOIN rigs USING (rig_id) "
      "WHERE sensor_type = ?1 AND ref_sensor_type = ?1");
  others.BindInt(1, kCamera);
  while (others.Step()) {
    RigCamera camera;
    camera.rig_id = static_cast<uint32_t>(others.Int(0));
    RigCamera reference = camera;
    reference.is_reference = true;
    reference.cam_from_rig = Rigid3d();
    if (!others.IsNull(2) && others.NumBytes(2) > 0) {
      Eigen::Matrix<double, 7, 1> pose;
      DoublesFromBlob(others, 2, "table rig_sensors", 7, pose.data());
      camera.cam_from_rig =
          Rigid3d(Eigen::Quaterniond(pose(0), pose(1), pose(2), pose(3)),
                  pose.tail<3>());
    }
    rigs.cameras[static_cast<camera_t>(others.Int(1))] = camera;
    rigs.cameras[static_cast<camera_t>(others.Int(3))] = reference;
  }
  return rigs;
}

// The registered images of the model by frame.
using ImagesOfFrame = std::map<uint32_t, std::vector<image_t>>;

bool IsReference(const CameraRigs& rigs, camera_t camera_id) {
  const auto camera = rigs.cameras.find(camera_id);
  return camera == rigs.cameras.end() || camera->second.is_reference;
}

// Replaces cam_from_rig by the poses in the model.
void TakePosesOfModel(const colmap::Reconstruction& model,
                      const ImagesOfFrame& images_of_frame, CameraRigs* rigs) {
  std::set<camera_t> done;
  for (const auto& [frame_id, image_ids] : images_of_frame) {
    const colmap::Image* reference = nullptr;
    for (const image_t image_id : image_ids) {
      const colmap::Image& image = model.Image(image_id);
      if (IsReference(*rigs, image.CameraId())) reference = &image;
    }
    if (reference == nullptr) continue;
    for (const image_t image_id : image_ids) {
      const colmap::Image& image = model.Image(image_id);
      if (&image == reference || !done.insert(image.CameraId()).second) {
        continue;
      }
      rigs->cameras.at(image.CameraId()).cam_from_rig =
          ComputeCam2FromCam1(CamFromWorld(*reference), CamFromWorld(image));
    }
  }
}

Rigid3d RigFromWorld(const colmap::Reconstruction& model,
                     const CameraRigs& rigs,
                     const std::vector<image_t>& image_ids) {
  Rigid3d rig_from_world;
  for (const image_t image_id : image_ids) {
    const colmap::Image& image = model.Image(image_id);
    const Rigid3d cam_from_world = CamFromWorld(image);
    if (IsReference(rigs, image.CameraId())) return cam_from_world;
    const RigCamera& camera = rigs.cameras.at(image.CameraId());
    rig_from_world =
        camera.cam_from_rig.value_or(Rigid3d()).Inverse() * cam_from_world;
  }
  return rig_from_world;
}

void WriteRigs(const std::map<uint32_t, std::set<camera_t>>& cameras_of_rig,
               const CameraRigs& rigs, std::ostream* file) {
  Write<uint64_t>(cameras_of_rig.size(), file);
  for (const auto& [rig_id, camera_ids] : cameras_of_rig) {
    Write<uint32_t>(rig_id, file);
    Write<uint32_t>(camera_ids.size(), file);
    for (const camera_t camera_id : camera_ids) {
      if (!IsReference(rigs, camera_id)) continue;
      Write<int32_t>(kCamera, file);
      Write<uint32_t>(camera_id, file);
    }
    for (const camera_t camera_id : camera_ids) {
      if (IsReference(rigs, camera_id)) continue;
      const RigCamera& camera = rigs.cameras.at(camera_id);
      Write<int32_t>(kCamera, file);
      Write<uint32_t>(camera_id, file);
      Write<uint8_t>(camera.cam_from_rig.has_value(), file);
      if (camera.cam_from_rig) WritePose(*camera.cam_from_rig, file);
    }
  }
}

}  // namespace

DatabaseFrames ReadDatabaseFrames(SqliteConnection* database) {
  DatabaseFrames result;
  result.has_tables =
      database->HasTable("frames") && database->HasTable("rig_sensors");
  if (!result.has_tables) return result;
  result.rigs = ReadRigs(database);
  bool needs_files = !result.rigs.cameras.empty();
  SqliteStatement statement(
      database,
      "SELECT image_id, camera_id, frame_id, rig_id FROM images "
      "JOIN frame_data ON data_id = image_id AND sensor_type = ?1 "
      "JOIN frames USING (frame_id)");
  statement.BindInt(1, kCamera);
  while (statement.Step()) {
    const FrameOfImage frame{static_cast<uint32_t>(statement.Int(2)),
                             static_cast<uint32_t>(statement.Int(3))};
    needs_files |=
        frame.frame_id != statement.Int(0) || frame.rig_id != statement.Int(1);
    const image_t image_id = static_cast<image_t>(statement.Int(0));
    const camera_t camera_id = static_cast<camera_t>(statement.Int(1));
    result.frames[image_id] = frame;
    if (result.rigs.cameras.count(camera_id)) {
      result.rigs.images[image_id] = {camera_id, frame.frame_id};
    }
  }
  if (!needs_files) result.frames.clear();
  return result;
}

bool WriteFrameFiles(const colmap::Reconstruction& model,
                     const ModelFrames& frames, const std::string& folder) {
  CameraRigs rigs = frames.rigs;
  ImagesOfFrame images_of_frame;
  std::map<uint32_t, uint32_t> rig_of_frame;
  std::map<uint32_t, std::set<camera_t>> cameras_of_rig;
  for (const image_t image_id : RegisteredImages(model)) {
    const auto frame = frames.frames.find(image_id);
    if (frame == frames.frames.end()) return false;
    images_of_frame[frame->second.frame_id].push_back(image_id);
    rig_of_frame[frame->second.frame_id] = frame->second.rig_id;
    cameras_of_rig[frame->second.rig_id].insert(
        model.Image(image_id).CameraId());
  }
  // All cameras of a rig that are cameras of the model, with or without
  // registered images.
  for (const auto& [camera_id, camera] : rigs.cameras) {
    if (model.ExistsCamera(camera_id) && cameras_of_rig.count(camera.rig_id)) {
      cameras_of_rig[camera.rig_id].insert(camera_id);
    }
  }
  TakePosesOfModel(model, images_of_frame, &rigs);

  std::ofstream frames_file(folder + "/frames.bin", std::ios::binary);
  Write<uint64_t>(images_of_frame.size(), &frames_file);
  for (const auto& [frame_id, images] : images_of_frame) {
    Write<uint32_t>(frame_id, &frames_file);
    Write<uint32_t>(rig_of_frame.at(frame_id), &frames_file);
    WritePose(RigFromWorld(model, rigs, images), &frames_file);
    Write<uint32_t>(images.size(), &frames_file);
    for (const image_t image_id : images) {
      Write<int32_t>(kCamera, &frames_file);
      Write<uint32_t>(model.Image(image_id).CameraId(), &frames_file);
      Write<uint64_t>(image_id, &frames_file);
    }
  }
  std::ofstream rigs_file(folder + "/rigs.bin", std::ios::binary);
  WriteRigs(cameras_of_rig, rigs, &rigs_file);
  return static_cast<bool>(frames_file.flush()) &&
         static_cast<bool>(rigs_file.flush());
}

}  // namespace adasfm
