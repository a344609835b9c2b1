// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/decode_image.h"

#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "colmap_ext/io/image_codecs.h"

namespace adasfm {
namespace {

// Conversion of an encoding's pixels to OpenCV's (blue first).
struct PixelFormat {
  int type;
  int conversion;  // -1: none
};

const std::map<std::string, PixelFormat>& PixelFormats() {
  // ROS names a Bayer pattern by its first two pixels, OpenCV by the second
  // row's second and third.
  static const std::map<std::string, PixelFormat> kFormats = {
      {"rgb8", {CV_8UC3, cv::COLOR_RGB2BGR}},
      {"bgr8", {CV_8UC3, -1}},
      {"8UC3", {CV_8UC3, -1}},
      {"rgba8", {CV_8UC4, cv::COLOR_RGBA2BGR}},
      {"bgra8", {CV_8UC4, cv::COLOR_BGRA2BGR}},
      {"mono8", {CV_8UC1, -1}},
      {"8UC1", {CV_8UC1, -1}},
      {"mono16", {CV_16UC1, -1}},
      {"bayer_rggb8", {CV_8UC1, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr8", {CV_8UC1, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg8", {CV_8UC1, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg8", {CV_8UC1, cv::COLOR_BayerGB2BGR}}};
  return kFormats;
}

bool BeginsWith(const ByteSpan& bytes, const std::vector<uint8_t>& magic) {
  return bytes.size >= magic.size() &&
         std::equal(magic.begin(), magic.end(), bytes.data);
}

std::string CopyFile(const RosCompressedImage& image, ImageFile* out) {
  if (BeginsWith(image.file, {0xff, 0xd8, 0xff})) {
    out->extension = ".jpg";
  } else if (BeginsWith(image.file, {0x89, 'P', 'N', 'G'})) {
    out->extension = ".png";
  } else {
    return "its photo (format '" + image.format +
           "') is neither JPEG nor PNG; choose another topic with "
           "--image_topic";
  }
  out->bytes.assign(image.file.data, image.file.data + image.file.size);
  return "";
}

cv::Mat SwapBytes(const cv::Mat& words) {
  cv::Mat swapped = words.clone();
  std::for_each(swapped.begin<uint16_t>(), swapped.end<uint16_t>(),
                [](uint16_t& word) {
                  word = static_cast<uint16_t>(word << 8 | word >> 8);
                });
  return swapped;
}

// Number of bits beyond eight in the brightest pixel.
int FindShift(const cv::Mat& words) {
  double brightest = 0.0;
  cv::minMaxLoc(words, nullptr, &brightest);
  int shift = 0;
  while (shift < 8 && brightest >= 256 << shift) ++shift;
  return shift;
}

}  // namespace

std::string ImageDecoder::DecodeRaw(const RosImage& image, ImageFile* file) {
  const auto format = PixelFormats().find(image.encoding);
  if (format == PixelFormats().end()) {
    return "its encoding '" + image.encoding.substr(0, 40) +
           "' is none of a photo (rgb8, bgr8, rgba8, bgra8, mono8, mono16, "
           "bayer_*8); choose another topic with --image_topic";
  }
  const PixelFormat& pixels = format->second;
  const uint64_t pixel_bytes = CV_ELEM_SIZE(pixels.type);
  // COLMAP's own limit is near this; larger sizes mean damage.
  constexpr uint32_t kMaxSide = 1 << 15;
  if (image.width == 0 || image.height == 0 || image.width > kMaxSide ||
      image.height > kMaxSide || image.row_bytes < image.width * pixel_bytes ||
      uint64_t{image.row_bytes} * image.height > image.pixels.size) {
    return "its " + std::to_string(image.width) + " x " +
           std::to_string(image.height) + " pixels do not fit its " +
           std::to_string(image.pixels.size) + " bytes";
  }
  cv::Mat picture(static_cast<int>(image.height), static_cast<int>(image.width),
                  pixels.type, const_cast<uint8_t*>(image.pixels.data),
                  image.row_bytes);
  if (CV_MAT_DEPTH(pixels.type) == CV_16U) {
    if (image.is_big_endian) picture = SwapBytes(picture);
    if (shift_ < 0) shift_ = FindShift(picture);
    // Truncation instead of rounding keeps the brightest pixels within eight
    // bits.
    cv::Mat words;
    cv::divide(picture, cv::Scalar(1 << shift_), words, 1.0, CV_32F);
    words.convertTo(picture, CV_8U, 1.0, -0.499);
  }
  if (pixels.conversion >= 0) {
    cv::Mat converted;
    cv::cvtColor(picture, converted, pixels.conversion);
    picture = converted;
  }
  file->extension = ".png";
  // Fast rather than small: the file is read again within minutes.
  file->bytes = EncodeImage(".png", picture, {cv::IMWRITE_PNG_COMPRESSION, 1});
  return "";
}

std::string ImageDecoder::Decode(const BagMessage& message, ImageFile* file) {
  const std::string malformed =
      "its bytes are not a " + message.topic->type + " that ROS knows";
  if (message.topic->type == "sensor_msgs/CompressedImage") {
    RosCompressedImage image;
    if (!ParseRosMessage(message.topic->encoding, message.bytes, &image)) {
      return malformed;
    }
    return CopyFile(image, file);
  }
  RosImage image;
  if (!ParseRosMessage(message.topic->encoding, message.bytes, &image)) {
    return malformed;
  }
  return DecodeRaw(image, file);
}

}  // namespace adasfm
