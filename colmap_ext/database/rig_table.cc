// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/rig_table.h"

#include <cmath>
#include <string>
#include <utility>

#include "colmap_ext/host/frames.h"
#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

RigCamera CameraFromRow(const SqliteStatement& statement) {
  const std::string row =
      "table adasfm_rig_cameras, camera " + std::to_string(statement.Int(0));
  RigCamera camera;
  camera.rig_id = static_cast<uint32_t>(statement.Int(1));
  camera.is_reference = camera.rig_id == statement.Int(0);
  Eigen::Vector4d qvec;
  Eigen::Vector3d tvec;
  DoublesFromBlob(statement, 2, row, 4, qvec.data());
  DoublesFromBlob(statement, 3, row, 3, tvec.data());
  camera.rotation_sigma_rad = statement.Double(4);
  camera.translation_sigma_m = statement.Double(5);
  if (!(std::abs(qvec.norm() - 1.0) < 1e-6) || !tvec.allFinite() ||
      !(camera.rotation_sigma_rad > 0.0 && camera.translation_sigma_m > 0.0)) {
    throw SqliteError(row + ": values that are no camera of a rig");
  }
  camera.cam_from_rig =
      Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
  return camera;
}

// All images with the same time form one frame.
void FillFramesByTime(SqliteConnection* database, CameraRigs* rigs) {
  SqliteStatement statement(database,
                            "SELECT images.image_id, camera_id, "
                            "dense_rank() OVER (ORDER BY timestamp_ns) "
                            "FROM images JOIN adasfm_image_times AS times ON "
                            "times.name = images.name");
  while (statement.Step()) {
    const camera_t camera_id = static_cast<camera_t>(statement.Int(1));
    if (rigs->cameras.count(camera_id) == 0) continue;
    rigs->images[static_cast<image_t>(statement.Int(0))] = {
        camera_id, static_cast<uint32_t>(statement.Int(2))};
  }
}

}  // namespace

void WriteRigCameras(const std::map<camera_t, RigCamera>& cameras,
                     SqliteConnection* database) {
  database->Execute("DROP TABLE IF EXISTS adasfm_rig_cameras");
  if (cameras.empty()) return;
  database->Execute(
      "CREATE TABLE adasfm_rig_cameras (camera_id INTEGER PRIMARY KEY NOT "
      "NULL, reference_camera_id INTEGER NOT NULL, qvec BLOB NOT NULL, "
      "tvec BLOB NOT NULL, rotation_sigma_rad REAL NOT NULL, "
      "translation_sigma_m REAL NOT NULL)");
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_rig_cameras VALUES "
                            "(?, ?, ?, ?, ?, ?)");
  for (const auto& [camera_id, camera] : cameras) {
    const Eigen::Quaterniond& q = camera.cam_from_rig.value().rotation;
    const Eigen::Vector4d qvec(q.w(), q.x(), q.y(), q.z());
    statement.Reset();
    statement.BindInt(1, camera_id);
    statement.BindInt(2, camera.rig_id);
    BindDoubles(&statement, 3, qvec.data(), 4);
    BindDoubles(&statement, 4, camera.cam_from_rig->translation.data(), 3);
    statement.BindDouble(5, camera.rotation_sigma_rad);
    statement.BindDouble(6, camera.translation_sigma_m);
    statement.Step();
  }
}

CameraRigs ReadCameraRigs(SqliteConnection* database) {
  CameraRigs rigs = ReadDatabaseFrames(database).rigs;
  if (!database->HasTable("adasfm_rig_cameras")) return rigs;
  std::map<camera_t, RigCamera> cameras;
  SqliteStatement statement(
      database,
      "SELECT camera_id, reference_camera_id, qvec, tvec, rotation_sigma_rad, "
      "translation_sigma_m FROM adasfm_rig_cameras");
  while (statement.Step()) {
    cameras[static_cast<camera_t>(statement.Int(0))] = CameraFromRow(statement);
  }
  if (!rigs.empty()) {
    // Keeps the host's ids and frames, and takes poses and sigmas of the
    // import.
    for (auto& [camera_id, camera] : rigs.cameras) {
      const auto known = cameras.find(camera_id);
      if (known == cameras.end() ||
          known->second.is_reference != camera.is_reference) {
        continue;
      }
      const uint32_t rig_id = camera.rig_id;
      camera = known->second;
      camera.rig_id = rig_id;
    }
    return rigs;
  }
  rigs.cameras = std::move(cameras);
  if (database->HasTable("adasfm_image_times")) {
    FillFramesByTime(database, &rigs);
  }
  return rigs;
}

}  // namespace adasfm
