// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

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
// numbers, and Kalibr's or EuRoC's name of the distortion model with its
// coefficients. Throws std::runtime_error, with the path, for other models and
// other numbers of values.
CalibratedCamera CameraOfCalibration(const std::string& distortion_model,
                                     const std::vector<double>& intrinsics,
                                     const std::vector<double>& distortion,
                                     const std::string& path);

// That of cam0 in a sensors.yaml (docs/reference/sensors.md). None where the
// file does not say it in these terms, and beside more cameras, whose photos
// are not of it.
std::optional<CalibratedCamera> ReadSensorsCamera(const std::string& path);

}  // namespace adasfm
