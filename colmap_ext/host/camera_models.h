// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/sqlite.h"
#include "core/status.h"

namespace adasfm {

// Camera models by their numbers, which are the same in all versions of COLMAP,
// including models that newer versions have and the linked library lacks.

bool IsNewerCameraModel(int model_id);

// None for a model that the linked library lacks.
std::optional<int> CameraModelNumParams(int model_id);

// COLMAP's name of any model up to version 4.2, as "PINHOLE"; "number N" for
// another.
std::string CameraModelName(int model_id);

// None for a name that the linked library does not know.
std::optional<int> CameraModelId(const std::string& name);

// The names of a model's parameters, comma-separated, in their order.
std::string CameraModelParamsInfo(int model_id);

// Parameters of a lens without distortion, with the principal point in the
// image centre [px].
std::vector<double> InitialCameraParams(int model_id, double focal_length_px,
                                        size_t width_px, size_t height_px);

// Replaces a model that the linked library lacks by one that it has with
// exactly the same projection: FISHEYE and SIMPLE_FISHEYE (equidistant) by
// OPENCV_FISHEYE without distortion. Others stay as they are.
void ConvertCameraModel(int* model_id, std::vector<double>* params);

// An error, naming the model, when a camera has a model of a newer COLMAP that
// cannot be converted.
Status CheckCameraModels(const std::string& path, SqliteConnection* database);

}  // namespace adasfm
