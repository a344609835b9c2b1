// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/camera_models.h>

namespace adasfm {

// Calls function(Model()) with the type of a camera model: it has kNumParams,
// and WorldToImage(params, u, v, &x, &y) from normalised coordinates to pixels
// in any number type. False for a model that COLMAP does not have.
template <typename Function>
bool VisitCameraModel(int model_id, const Function& function) {
  switch (model_id) {
#define CAMERA_MODEL_CASE(Model) \
  case colmap::Model::kModelId:  \
    function(colmap::Model());   \
    return true;
    CAMERA_MODEL_CASES
#undef CAMERA_MODEL_CASE
  }
  return false;
}

}  // namespace adasfm
