// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/status.h"
#include "sensors/bags/bag_reader.h"

namespace adasfm {

// A photo as a file's bytes.
struct ImageFile {
  std::string extension;  // ".png" or ".jpg"
  std::vector<uint8_t> bytes;
};

// Makes files of a bag's photos. Compressed ones (JPEG, PNG) stay as they are;
// raw ones (rgb8, bgr8, rgba8, bgra8, mono8, mono16, Bayer of 8 bits) become
// PNG. 16 bits become 8 by the brightest pixel of the first photo, since
// sensors of 10 and 12 bits leave the upper ones empty; all photos alike.
class ImageDecoder {
 public:
  // What is wrong with the message, nothing when *file holds the photo.
  std::string Decode(const BagMessage& message, ImageFile* file);

 private:
  std::string DecodeRaw(const RosImage& image, ImageFile* file);

  int shift_ = -1;  // of 16 bits to 8; -1 before the first photo
};

}  // namespace adasfm
