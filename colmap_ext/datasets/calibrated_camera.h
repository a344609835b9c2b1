// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// A camera in COLMAP's terms: the model's name, its parameters
// (comma-separated, pixel centres at 0.5), and the size of its photos, 0 where
// that is not known.
struct CalibratedCamera {
  std::string model;
  std::string params;
  int width_px = 0;
  int height_px = 0;
};

// From what calibration tools write: fu, fv, cu, cv with pixel centres at whole
// numbers, and the distortion model's name in Kalibr, EuRoC or ROS with its
// coefficients. Those of a lens with tangential distortion (k1 k2 p1 p2 k3 k4
// k5 k6, four to eight, the rest zero) become PINHOLE, OPENCV or FULL_OPENCV,
// those of a fisheye (four) OPENCV_FISHEYE; no name or "none" is a pinhole.
// Otherwise the status says what is wrong.
StatusOr<CalibratedCamera> CameraOfCalibration(
    const std::string& distortion_model, const std::vector<double>& intrinsics,
    std::vector<double> distortion);

// That of cam0 in a sensors.yaml (docs/reference/sensors.md). None without
// intrinsics, of a file that cannot be read, about which the importer
// complains, and beside more cameras, whose photos are not of it. Intrinsics
// that cannot be used are an error, with the path.
StatusOr<std::optional<CalibratedCamera>> ReadSensorsCamera(
    const std::string& path);

}  // namespace adasfm
