// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "sensors/bags/ros_messages.h"

namespace adasfm {

// COLMAP's name and parameters (comma-separated, pixel centres at .5).
struct CameraText {
  std::string model;
  std::string params;
};

// The camera of a bag's photos: plumb_bob and rational_polynomial become
// PINHOLE, OPENCV or FULL_OPENCV, equidistant becomes OPENCV_FISHEYE; of
// rectified photos the projection P counts. Returns why the message cannot be
// used, nothing when *camera is set.
std::string CameraFromInfo(const RosCameraInfo& info, bool is_rectified,
                           CameraText* camera);

}  // namespace adasfm
