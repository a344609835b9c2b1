// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/camera_models.h"

#include <base/camera_models.h>

#include <map>

namespace adasfm {
namespace {

constexpr int kSimpleFisheye = 14;
constexpr int kFisheye = 15;

const std::map<int, std::string>& NewerModels() {
  static const std::map<int, std::string> names = {
      {11, "RAD_TAN_THIN_PRISM_FISHEYE"},
      {12, "SIMPLE_DIVISION"},
      {13, "DIVISION"},
      {kSimpleFisheye, "SIMPLE_FISHEYE"},
      {kFisheye, "FISHEYE"},
      {16, "EUCM"},
      {17, "EQUIRECTANGULAR"},
  };
  return names;
}

}  // namespace

bool IsNewerCameraModel(int model_id) {
  return NewerModels().count(model_id) > 0;
}

std::optional<int> CameraModelNumParams(int model_id) {
  if (!colmap::ExistsCameraModelWithId(model_id)) return std::nullopt;
  return static_cast<int>(colmap::CameraModelNumParams(model_id));
}

std::string CameraModelName(int model_id) {
  if (colmap::ExistsCameraModelWithId(model_id)) {
    return colmap::CameraModelIdToName(model_id);
  }
  const auto found = NewerModels().find(model_id);
  return found == NewerModels().end() ? "number " + std::to_string(model_id)
                                      : found->second;
}

std::optional<int> CameraModelId(const std::string& name) {
  if (!colmap::ExistsCameraModelWithName(name)) return std::nullopt;
  return colmap::CameraModelNameToId(name);
}

std::string CameraModelParamsInfo(int model_id) {
  return colmap::CameraModelParamsInfo(model_id);
}

std::vector<double> InitialCameraParams(int model_id, double focal_length_px,
                                        size_t width_px, size_t height_px) {
  return colmap::CameraModelInitializeParams(model_id, focal_length_px,
                                             width_px, height_px);
}

void ConvertCameraModel(int* model_id, std::vector<double>* params) {
  // f, cx, cy and fx, fy, cx, cy.
  if (*model_id == kSimpleFisheye && params->size() == 3) {
    params->insert(params->begin(), params->front());
  } else if (*model_id != kFisheye || params->size() != 4) {
    return;
  }
  params->resize(8, 0.0);
  *model_id = colmap::OpenCVFisheyeCameraModel::kModelId;
}

Status CheckCameraModels(const std::string& path, SqliteConnection* database) {
  SqliteStatement statement(
      database,
      "SELECT camera_id, model FROM cameras WHERE model NOT IN (?, ?) "
      "ORDER BY camera_id");
  statement.BindInt(1, kSimpleFisheye);
  statement.BindInt(2, kFisheye);
  while (statement.Step()) {
    const int model_id = statement.Int(1);
    if (!IsNewerCameraModel(model_id)) continue;
    return Status::Error(path + ": camera " + std::to_string(statement.Int(0)) +
                         " has the model " + CameraModelName(model_id) +
                         ", which this program does not have; extract the "
                         "features again with another camera model, as OPENCV "
                         "or OPENCV_FISHEYE");
  }
  return Status::Ok();
}

}  // namespace adasfm
