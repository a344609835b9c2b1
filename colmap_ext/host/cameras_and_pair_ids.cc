// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstring>

#include "colmap_ext/host/camera_models.h"
#include "colmap_ext/host/database.h"

namespace adasfm {

// Factor in COLMAP's pair ids, the same in all versions.
static constexpr int64_t kPairIdFactor = 2147483647;

[[noreturn]] static void ThrowRowError(int64_t row, const std::string& what) {
  throw SqliteError("table cameras, row " + std::to_string(row) + ": " + what);
}

int64_t PairIdFromImagePair(const ImagePair& pair) {
  const auto [smaller, larger] = std::minmax(pair.image_id1, pair.image_id2);
  return kPairIdFactor * smaller + larger;
}

ImagePair ImagePairFromPairId(int64_t pair_id) {
  return ImagePair(static_cast<image_t>(pair_id / kPairIdFactor),
                   static_cast<image_t>(pair_id % kPairIdFactor));
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
    const std::optional<int> num_params = CameraModelNumParams(model_id);
    if (!num_params) {
      ThrowRowError(camera_id,
                    "unknown camera model " + CameraModelName(model_id));
    }
    if (static_cast<int>(params.size()) != *num_params ||
        statement.NumBytes(4) % sizeof(double) != 0) {
      ThrowRowError(camera_id, "wrong number of parameters");
    }
    cameras.emplace(
        camera_id, MakeCamera(camera_id, model_id, statement.Int(2),
                              statement.Int(3), params, statement.Int(5) != 0));
  }
  return cameras;
}

}  // namespace adasfm
