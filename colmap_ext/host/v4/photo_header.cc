// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/photo_header.h"

#include <colmap/sensor/bitmap.h>

namespace adasfm {

std::optional<PhotoHeader> ReadPhotoHeader(const std::string& path) {
  colmap::Bitmap bitmap;
  if (!bitmap.Read(path, /*as_rgb=*/false)) return std::nullopt;
  PhotoHeader header{bitmap.Width(), bitmap.Height(), std::nullopt,
                     std::nullopt};
  const std::optional<double> focal_length_px = bitmap.ExifFocalLength();
  if (focal_length_px && *focal_length_px > 0.0) {
    header.focal_length_px = focal_length_px;
  }
  const std::optional<double> latitude = bitmap.ExifLatitude();
  const std::optional<double> longitude = bitmap.ExifLongitude();
  const std::optional<double> altitude = bitmap.ExifAltitude();
  if (latitude && longitude && altitude) {
    header.position = Eigen::Vector3d(*latitude, *longitude, *altitude);
  }
  return header;
}

}  // namespace adasfm
