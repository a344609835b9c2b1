// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/camera_from_info.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "colmap_ext/datasets/dataset_files.h"

namespace adasfm {
namespace {

// ROS's order k1 k2 p1 p2 k3 k4 k5 k6 is FULL_OPENCV's.
constexpr size_t kNumRational = 8;

}  // namespace

std::string CameraFromInfo(const RosCameraInfo& info, bool is_rectified,
                           CameraText* camera) {
  const double fx = is_rectified ? info.p[0] : info.k[0];
  const double fy = is_rectified ? info.p[5] : info.k[4];
  const double cx = is_rectified ? info.p[2] : info.k[2];
  const double cy = is_rectified ? info.p[6] : info.k[5];
  std::vector<double> distortion = info.distortion;
  const bool is_finite =
      std::isfinite(fx + fy + cx + cy) &&
      std::all_of(distortion.begin(), distortion.end(),
                  [](double value) { return std::isfinite(value); });
  if (!is_finite || fx <= 0.0 || fy <= 0.0) return "the camera is uncalibrated";
  if (info.binning_x > 1 || info.binning_y > 1 ||
      (info.roi_width > 0 && info.roi_width != info.width) ||
      (info.roi_height > 0 && info.roi_height != info.height)) {
    return "binning and regions of interest are not supported";
  }
  // ROS has the centre of the first pixel at 0.
  std::vector<double> params = {fx, fy, cx + 0.5, cy + 0.5};
  const bool is_zero = std::all_of(distortion.begin(), distortion.end(),
                                   [](double value) { return value == 0.0; });
  if (is_rectified || is_zero) {
    camera->model = "PINHOLE";
  } else if (info.distortion_model == "equidistant" ||
             info.distortion_model == "fisheye") {
    if (distortion.size() != 4) return "its distortion has not 4 coefficients";
    camera->model = "OPENCV_FISHEYE";
  } else if (info.distortion_model == "plumb_bob" ||
             info.distortion_model == "rational_polynomial") {
    if (distortion.size() < 4 || distortion.size() > kNumRational) {
      return "its distortion has not 4, 5 or 8 coefficients";
    }
    const bool is_short =
        std::all_of(distortion.begin() + 4, distortion.end(),
                    [](double value) { return value == 0.0; });
    distortion.resize(is_short ? 4 : kNumRational, 0.0);
    camera->model = is_short ? "OPENCV" : "FULL_OPENCV";
  } else {
    return "its distortion model '" + info.distortion_model.substr(0, 40) +
           "' is unknown";
  }
  if (camera->model != "PINHOLE") {
    params.insert(params.end(), distortion.begin(), distortion.end());
  }
  camera->params = JoinNumbers(params);
  return "";
}

}  // namespace adasfm
