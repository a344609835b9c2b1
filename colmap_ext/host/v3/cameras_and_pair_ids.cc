// SPDX-License-Identifier: BSD-3-Clause
#include <base/camera_models.h>

#include <cstring>

#include "colmap_ext/host/camera_models.h"
#include "colmap_ext/host/database.h"

namespace adasfm {

[[noreturn]] static void ThrowRowError(int64_t row, const std::string& what) {
  throw SqliteError("table cameras, row " + std::to_string(row) + ": " + what);
}

int64_t PairIdFromImagePair(const ImagePair& pair) {
  return colmap::Database::ImagePairToPairId(pair.image_id1, pair.image_id2);
}

ImagePair ImagePairFromPairId(int64_t pair_id) {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  colmap::Database::PairIdToImagePair(pair_id, &image_id1, &image_id2);
  return ImagePair(image_id1, image_id2);
}

std::map<camera_t, colmap::Camera> ReadCameras(SqliteConnection* database) {
  std::map<camera_t, colmap::Camera> cameras;
  SqliteStatement statement(
      database,
      "SELECT camera_id, model, width, height, params, prior_focal_length "
      "FROM cameras ORDER BY camera_id");
  while (statement.Step()) {
    const int64_t camera_id = statement.Int(0);
    int model_id = statement.Int(1);
    std::vector<double> params(statement.NumBytes(4) / sizeof(double));
    if (!params.empty()) {
      std::memcpy(params.data(), statement.Blob(4),
                  params.size() * sizeof(double));
    }
    ConvertCameraModel(&model_id, &params);
    if (!colmap::ExistsCameraModelWithId(model_id)) {
      ThrowRowError(camera_id,
                    "unknown camera model " + CameraModelName(model_id));
    }
    colmap::Camera camera;
    camera.SetCameraId(camera_id);
    camera.SetModelId(model_id);
    camera.SetWidth(statement.Int(2));
    camera.SetHeight(statement.Int(3));
    camera.SetPriorFocalLength(statement.Int(5) != 0);
    if (params.size() != camera.NumParams() ||
        statement.NumBytes(4) % sizeof(double) != 0) {
      ThrowRowError(camera_id, "wrong number of parameters");
    }
    camera.SetParams(params);
    cameras.emplace(camera_id, std::move(camera));
  }
  return cameras;
}

}  // namespace adasfm
