// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/camera_from_info.h"

namespace adasfm {

StatusOr<CalibratedCamera> CameraFromInfo(const RosCameraInfo& info,
                                          bool is_rectified) {
  if (info.binning_x > 1 || info.binning_y > 1 ||
      (info.roi_width > 0 && info.roi_width != info.width) ||
      (info.roi_height > 0 && info.roi_height != info.height)) {
    return Status::Error("binning and regions of interest are not supported");
  }
  // ROS has the centre of the first pixel at 0.
  if (is_rectified) {
    return CameraOfCalibration(
        "none", {info.p[0], info.p[5], info.p[2], info.p[6]}, {});
  }
  return CameraOfCalibration(info.distortion_model,
                             {info.k[0], info.k[4], info.k[2], info.k[5]},
                             info.distortion);
}

}  // namespace adasfm
