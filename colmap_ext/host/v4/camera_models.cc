// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/camera_models.h"

#include <colmap/sensor/models.h>

namespace adasfm {
namespace {

colmap::CameraModelId HostId(int model_id) {
  return static_cast<colmap::CameraModelId>(model_id);
}

}  // namespace

// COLMAP 4.2 has all models known here, but EQUIRECTANGULAR images have no
// plane z = 1.
bool IsNewerCameraModel(int model_id) {
  return HostId(model_id) == colmap::CameraModelId::kEquirectangular;
}

std::optional<int> CameraModelNumParams(int model_id) {
  if (!colmap::ExistsCameraModelWithId(HostId(model_id))) return std::nullopt;
  return static_cast<int>(colmap::CameraModelNumParams(HostId(model_id)));
}

std::string CameraModelName(int model_id) {
  if (!colmap::ExistsCameraModelWithId(HostId(model_id))) {
    return "number " + std::to_string(model_id);
  }
  return colmap::CameraModelIdToName(HostId(model_id));
}

std::optional<int> CameraModelId(const std::string& name) {
  if (!colmap::ExistsCameraModelWithName(name)) return std::nullopt;
  return static_cast<int>(colmap::CameraModelNameToId(name));
}

std::string CameraModelParamsInfo(int model_id) {
  return colmap::CameraModelParamsInfo(HostId(model_id));
}

std::vector<double> InitialCameraParams(int model_id, double focal_length_px,
                                        size_t width_px, size_t height_px) {
  return colmap::CameraModelInitializeParams(HostId(model_id), focal_length_px,
                                             width_px, height_px);
}

void ConvertCameraModel(int*, std::vector<double>*) {}

Status CheckCameraModels(const std::string& path, SqliteConnection* database) {
  SqliteStatement statement(
      database, "SELECT camera_id, model FROM cameras ORDER BY camera_id");
  while (statement.Step()) {
    const int model_id = statement.Int(1);
    if (!IsNewerCameraModel(model_id)) continue;
    return Status::Error(path + ": camera " + std::to_string(statement.Int(0)) +
                         " has the model " + CameraModelName(model_id) +
                         ", whose images have no plane; cut them into views "
                         "with another camera model, as PINHOLE");
  }
  return Status::Ok();
}

}  // namespace adasfm
