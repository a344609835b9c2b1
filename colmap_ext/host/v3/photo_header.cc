// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/photo_header.h"

#include <util/bitmap.h>

namespace adasfm {

std::optional<PhotoHeader> ReadPhotoHeader(const std::string& path) {
  colmap::Bitmap bitmap;
  if (!bitmap.Read(path, /*as_rgb=*/false)) return std::nullopt;
  PhotoHeader header{bitmap.Width(), bitmap.Height(), std::nullopt,
                     std::nullopt};
  double focal_length_px = 0.0;
  if (bitmap.ExifFocalLength(&focal_length_px) && focal_length_px > 0.0) {
    header.focal_length_px = focal_length_px;
  }
  Eigen::Vector3d position;
  if (bitmap.ExifLatitude(&position.x()) &&
      bitmap.ExifLongitude(&position.y()) &&
      bitmap.ExifAltitude(&position.z())) {
    header.position = position;
  }
  return header;
}

}  // namespace adasfm
