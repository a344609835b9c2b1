// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <colmap/sensor/models.h>

namespace adasfm {

// A camera model of COLMAP. Project: pixel of (u, v) on the plane z = 1, in any
// number type; false where there is no pixel.
template <typename Model>
struct CameraModelType {
  static constexpr int kNumParams = Model::num_params;

  template <typename T>
  static bool Project(const T* params, const T& u, const T& v, T* pixel) {
    return Model::ImgFromCam(params, u, v, T(1.0), &pixel[0], &pixel[1]);
  }
};

// Calls function(CameraModelType()) with the type of a camera model. False for
// a model that COLMAP does not have.
template <typename Function>
bool VisitCameraModel(int model_id, const Function& function) {
  switch (static_cast<colmap::CameraModelId>(model_id)) {
#define CAMERA_MODEL_CASE(Model)                \
  case colmap::Model::model_id:                 \
    function(CameraModelType<colmap::Model>()); \
    return true;
    CAMERA_MODEL_CASES
#undef CAMERA_MODEL_CASE
    default:
      return false;
  }
}

}  // namespace adasfm
