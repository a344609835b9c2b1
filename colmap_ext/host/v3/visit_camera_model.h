// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/camera_models.h>

namespace adasfm {

// A camera model of COLMAP. Project: pixel of (u, v) on the plane z = 1, in any
// number type.
template <typename Model>
struct CameraModelType {
  static constexpr int kNumParams = Model::kNumParams;

  template <typename T>
  static bool Project(const T* params, const T& u, const T& v, T* pixel) {
    Model::WorldToImage(params, u, v, &pixel[0], &pixel[1]);
    return true;
  }
};

// Calls function(CameraModelType()) with the type of a camera model. False for
// a model that COLMAP does not have.
template <typename Function>
bool VisitCameraModel(int model_id, const Function& function) {
  switch (model_id) {
#define CAMERA_MODEL_CASE(Model)                \
  case colmap::Model::kModelId:                 \
    function(CameraModelType<colmap::Model>()); \
    return true;
    CAMERA_MODEL_CASES
#undef CAMERA_MODEL_CASE
  }
  return false;
}

}  // namespace adasfm
