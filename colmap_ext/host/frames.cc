// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/frames.h"

#include <fstream>
#include <set>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

// COLMAP's number of the sensor type.
constexpr int32_t kCamera = 0;

template <typename T>
void Write(T value, std::ostream* file) {
  file->write(reinterpret_cast<const char*>(&value), sizeof(value));
}

void WriteRigs(const std::set<std::pair<uint32_t, camera_t>>& rigs,
               std::ostream* file) {
  Write<uint64_t>(rigs.size(), file);
  for (const auto& [rig_id, camera_id] : rigs) {
    Write<uint32_t>(rig_id, file);
    Write<uint32_t>(1, file);
    Write<int32_t>(kCamera, file);
    Write<uint32_t>(camera_id, file);
  }
}

void WriteFrame(const colmap::Image& image, const FrameOfImage& frame,
                std::ostream* file) {
  Write<uint32_t>(frame.frame_id, file);
  Write<uint32_t>(frame.rig_id, file);
  const Rigid3d cam_from_world = CamFromWorld(image);
  const Eigen::Quaterniond& rotation = cam_from_world.rotation;
  for (const double value :
       {rotation.w(), rotation.x(), rotation.y(), rotation.z()}) {
    Write<double>(value, file);
  }
  for (int i = 0; i < 3; ++i)
    Write<double>(cam_from_world.translation(i), file);
  Write<uint32_t>(1, file);
  Write<int32_t>(kCamera, file);
  Write<uint32_t>(image.CameraId(), file);
  Write<uint64_t>(image.ImageId(), file);
}

// A frame with images of two cameras, or of one that is not its rig's
// reference.
bool HasCameraRigs(SqliteConnection* database) {
  SqliteStatement statement(
      database,
      "SELECT 1 FROM frame_data JOIN frames USING (frame_id) "
      "JOIN rigs USING (rig_id) WHERE sensor_type = ?1 AND "
      "(ref_sensor_type <> ?1 OR ref_sensor_id <> sensor_id) "
      "UNION ALL SELECT 1 FROM frame_data WHERE sensor_type = ?1 "
      "GROUP BY frame_id HAVING count(*) > 1 LIMIT 1");
  statement.BindInt(1, kCamera);
  return statement.Step();
}

}  // namespace

StatusOr<DatabaseFrames> ReadDatabaseFrames(const std::string& database_path) {
  DatabaseFrames result;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    if (!database.HasTable("frames")) return result;
    result.has_camera_rigs = HasCameraRigs(&database);
    if (result.has_camera_rigs) return result;
    bool needs_files = false;
    SqliteStatement statement(
        &database,
        "SELECT image_id, camera_id, frame_id, rig_id FROM images "
        "JOIN frame_data ON data_id = image_id AND sensor_type = ?1 "
        "JOIN frames USING (frame_id)");
    statement.BindInt(1, kCamera);
    while (statement.Step()) {
      const FrameOfImage frame{static_cast<uint32_t>(statement.Int(2)),
                               static_cast<uint32_t>(statement.Int(3))};
      needs_files |= frame.frame_id != statement.Int(0) ||
                     frame.rig_id != statement.Int(1);
      result.frames[statement.Int(0)] = frame;
    }
    if (!needs_files) result.frames.clear();
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return result;
}

bool WriteFrameFiles(const colmap::Reconstruction& model,
                     const std::map<image_t, FrameOfImage>& frames,
                     const std::string& folder) {
  std::set<std::pair<uint32_t, camera_t>> rigs;
  const std::set<image_t> image_ids(model.RegImageIds().begin(),
                                    model.RegImageIds().end());
  std::ofstream frames_file(folder + "/frames.bin", std::ios::binary);
  Write<uint64_t>(image_ids.size(), &frames_file);
  for (const image_t image_id : image_ids) {
    const auto frame = frames.find(image_id);
    if (frame == frames.end()) return false;
    const colmap::Image& image = model.Image(image_id);
    WriteFrame(image, frame->second, &frames_file);
    rigs.emplace(frame->second.rig_id, image.CameraId());
  }
  std::ofstream rigs_file(folder + "/rigs.bin", std::ios::binary);
  WriteRigs(rigs, &rigs_file);
  return static_cast<bool>(frames_file.flush()) &&
         static_cast<bool>(rigs_file.flush());
}

}  // namespace adasfm
