// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/status.h"
#include "sensors/bags/bag_reader.h"

namespace adasfm {

// The bytes of a photo's file.
struct ImageFile {
  std::string extension;  // ".png" or ".jpg"
  std::vector<uint8_t> bytes;
};

// Converts a bag's photos to files. Compressed photos (JPEG, PNG) are copied;
// raw ones (rgb8, bgr8, rgba8, bgra8, mono8, mono16, Bayer of 8 bits) become
// PNG. 16 bits are shifted to 8 by the brightest pixel of the first photo,
// equally for all photos, since sensors of 10 and 12 bits leave the upper bits
// empty.
class ImageDecoder {
 public:
  // Returns an error text; an empty text when *file has the photo.
  std::string Decode(const BagMessage& message, ImageFile* file);

 private:
  std::string DecodeRaw(const RosImage& image, ImageFile* file);

  int shift_ = -1;  // from 16 bits to 8; -1 before the first photo
};

}  // namespace adasfm
