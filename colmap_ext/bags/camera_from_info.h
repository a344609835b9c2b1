// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/datasets/calibrated_camera.h"
#include "core/status.h"
#include "sensors/bags/ros_messages.h"

namespace adasfm {

// The camera of a bag's photos, for rectified photos from the projection P; or
// an error why the message cannot be used.
StatusOr<CalibratedCamera> CameraFromInfo(const RosCameraInfo& info,
                                          bool is_rectified);

}  // namespace adasfm
