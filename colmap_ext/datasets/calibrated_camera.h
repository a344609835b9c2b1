// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// A camera in COLMAP's terms: the model's name, its parameters
// (comma-separated, pixel centres at 0.5), and the size of its photos, 0 where
// unknown.
struct CalibratedCamera {
  std::string model;
  std::string params;
  int width_px = 0;
  int height_px = 0;
};

// Converts the output of calibration tools: fu, fv, cu, cv with pixel centres
// at whole numbers, and the distortion model's name in Kalibr, EuRoC or ROS
// with its coefficients. Radial-tangential models (k1 k2 p1 p2 k3 k4 k5 k6,
// four to eight, the rest zero) become PINHOLE, OPENCV or FULL_OPENCV; fisheye
// models (four) become OPENCV_FISHEYE; no name or "none" becomes PINHOLE.
// Otherwise the status states what is wrong.
StatusOr<CalibratedCamera> CameraOfCalibration(
    const std::string& distortion_model, const std::vector<double>& intrinsics,
    std::vector<double> distortion);

// The camera of cam0 in a sensors.yaml (docs/reference/sensors.md). None
// without intrinsics; for an unreadable file, which the importer reports; and
// with further cameras, whose photos cam0 does not describe. An error, with the
// path, for unusable intrinsics.
StatusOr<std::optional<CalibratedCamera>> ReadSensorsCamera(
    const std::string& path);

}  // namespace adasfm
