// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace adasfm {

struct PhotoHeader {
  int width_px = 0;
  int height_px = 0;
  // From EXIF.
  std::optional<double> focal_length_px;
  // Latitude and longitude in degrees, altitude in m.
  std::optional<Eigen::Vector3d> position;
};

// Uses COLMAP's own reader, which reads the whole photo. None for a file that
// this reader cannot read as an image.
std::optional<PhotoHeader> ReadPhotoHeader(const std::string& path);

}  // namespace adasfm
