// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/decode_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "colmap_ext/bags/camera_from_info.h"
#include "colmap_ext/bags/select_photos.h"
#include "tests/testing/bag_writer.h"

namespace adasfm {
namespace {

using testing::HasSubstr;

constexpr timestamp_t kStartNs = 1'600'000'000'000'000'000;

class DecodeImage : public testing::Test {
 protected:
  std::string Decode(const std::string& message, const std::string& type,
                     cv::Mat* picture) {
    const BagTopic topic{"/camera", type, RosEncoding::kCdr};
    ImageFile file;
    const std::string cause = decoder_.Decode(
        {&topic,
         {reinterpret_cast<const uint8_t*>(message.data()), message.size()}},
        &file);
    if (cause.empty()) *picture = cv::imdecode(file.bytes, cv::IMREAD_COLOR);
    return cause;
  }

  // An image message of 4 x 2 pixels; `padding` bytes follow each row.
  std::string Raw(const std::string& encoding, const std::string& pixel,
                  bool is_big_endian = false, uint32_t padding = 3) {
    std::string pixels;
    for (int row = 0; row < 2; ++row) {
      for (int column = 0; column < 4; ++column) pixels += pixel;
      pixels += std::string(padding, 'x');
    }
    return ImageMessage({kStartNs, "camera", is_big_endian}, 2, 4, encoding,
                        4 * pixel.size() + padding, pixels);
  }

  ImageDecoder decoder_;
};

TEST_F(DecodeImage, EncodingsKeepTheirColours) {
  const cv::Vec3b bgr(10, 20, 30);
  const std::pair<const char*, std::string> encodings[] = {
      {"bgr8", "\x0a\x14\x1e"},
      {"rgb8", "\x1e\x14\x0a"},
      {"bgra8", "\x0a\x14\x1e\xff"},
      {"rgba8", "\x1e\x14\x0a\xff"}};
  for (const auto& [encoding, pixel] : encodings) {
    SCOPED_TRACE(encoding);
    cv::Mat picture;
    ASSERT_EQ(Decode(Raw(encoding, pixel), "sensor_msgs/Image", &picture), "");
    ASSERT_EQ(picture.size(), cv::Size(4, 2));
    EXPECT_EQ(picture.at<cv::Vec3b>(1, 3), bgr);
  }
  cv::Mat picture;
  ASSERT_EQ(Decode(Raw("mono8", "\x2a"), "sensor_msgs/Image", &picture), "");
  EXPECT_EQ(picture.at<cv::Vec3b>(1, 3), cv::Vec3b(42, 42, 42));
}

TEST_F(DecodeImage, BayerPatternsAreNamedByTheirFirstPixels) {
  // Red light only: bright where the pattern is red.
  const std::pair<const char*, cv::Point> patterns[] = {
      {"bayer_rggb8", {0, 0}},
      {"bayer_grbg8", {1, 0}},
      {"bayer_gbrg8", {0, 1}},
      {"bayer_bggr8", {1, 1}}};
  for (const auto& [encoding, red] : patterns) {
    SCOPED_TRACE(encoding);
    std::string pixels;
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        const bool is_red = x % 2 == red.x && y % 2 == red.y;
        pixels += is_red ? '\x64' : '\0';
      }
    }
    cv::Mat picture;
    ASSERT_EQ(Decode(ImageMessage({kStartNs, "c"}, 8, 8, encoding, 8, pixels),
                     "sensor_msgs/Image", &picture),
              "");
    EXPECT_EQ(picture.at<cv::Vec3b>(4, 4), cv::Vec3b(0, 0, 100));
  }
}

TEST_F(DecodeImage, TwelveBitsBecomeEightInAllPhotosAlike) {
  cv::Mat picture;
  ASSERT_EQ(Decode(Raw("mono16", std::string("\x00\x0f", 2), false, 0),
                   "sensor_msgs/Image", &picture),
            "");
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 0)[0], 0xf0);
  // A dark photo stays dark, in big-endian byte order too.
  ASSERT_EQ(Decode(Raw("mono16", std::string("\x00\x80", 2), true, 0),
                   "sensor_msgs/Image", &picture),
            "");
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 0)[0], 0x08);
}

TEST_F(DecodeImage, WhatIsNoPhotoIsNamed) {
  cv::Mat picture;
  const std::string image = "sensor_msgs/Image";
  EXPECT_THAT(Decode(Raw("32FC1", "1234"), image, &picture),
              HasSubstr("'32FC1'"));
  EXPECT_THAT(
      Decode(ImageMessage({kStartNs, ""}, 1000, 1000, "mono8", 1000, "few"),
             image, &picture),
      HasSubstr("1000 x 1000 pixels do not fit its 3 bytes"));
  EXPECT_THAT(Decode(ImageMessage({kStartNs, ""}, 1u << 31, 1u << 31, "bgr8",
                                  1u << 31, "few"),
                     image, &picture),
              HasSubstr("do not fit"));
  EXPECT_THAT(Decode(CompressedImageMessage({kStartNs, ""}, "h264", "\0\0\1"),
                     "sensor_msgs/CompressedImage", &picture),
              HasSubstr("'h264'"));
}

RosCameraInfo Info(const std::string& model,
                   const std::vector<double>& distortion) {
  RosCameraInfo info;
  info.width = 640;
  info.height = 480;
  info.distortion_model = model;
  info.distortion = distortion;
  info.k = {500, 0, 320, 0, 510, 240, 0, 0, 1};
  info.p = {400, 0, 310, 0, 0, 410, 230, 0, 0, 0, 1, 0};
  return info;
}

TEST(CameraFromInfo, ModelsOfRosBecomeColmaps) {
  const auto expect = [](const RosCameraInfo& info, bool is_rectified,
                         const std::string& model, const std::string& params) {
    const auto camera = CameraFromInfo(info, is_rectified);
    ASSERT_TRUE(camera.ok()) << camera.status().message();
    EXPECT_EQ(camera->model, model);
    EXPECT_EQ(camera->params, params);
  };
  expect(Info("plumb_bob", {0, 0, 0, 0, 0}), false, "PINHOLE",
         "500,510,320.5,240.5");
  expect(Info("plumb_bob", {1, 2, 3, 4, 0}), false, "OPENCV",
         "500,510,320.5,240.5,1,2,3,4");
  expect(Info("plumb_bob", {1, 2, 3, 4, 5}), false, "FULL_OPENCV",
         "500,510,320.5,240.5,1,2,3,4,5,0,0,0");
  expect(Info("rational_polynomial", {1, 2, 3, 4, 5, 6, 7, 8}), false,
         "FULL_OPENCV", "500,510,320.5,240.5,1,2,3,4,5,6,7,8");
  expect(Info("equidistant", {1, 2, 3, 4}), false, "OPENCV_FISHEYE",
         "500,510,320.5,240.5,1,2,3,4");
  // An equidistant camera without distortion is a fisheye, not a pinhole.
  expect(Info("equidistant", {0, 0, 0, 0}), false, "OPENCV_FISHEYE",
         "500,510,320.5,240.5,0,0,0,0");
  expect(Info("plumb_bob", {1, 2, 3, 4, 5}), true, "PINHOLE",
         "400,410,310.5,230.5");
}

TEST(CameraFromInfo, WhatCannotBeUsedIsNamed) {
  const auto cause = [](const RosCameraInfo& info) {
    return CameraFromInfo(info, false).status().message();
  };
  RosCameraInfo info = Info("plumb_bob", {});
  info.k.fill(0.0);
  EXPECT_THAT(cause(info), HasSubstr("uncalibrated"));
  info = Info("plumb_bob", {});
  info.binning_x = 2;
  EXPECT_THAT(cause(info), HasSubstr("binning"));
  EXPECT_THAT(cause(Info("omni", {1, 2, 3, 4})), HasSubstr("'omni'"));
  EXPECT_THAT(cause(Info("equidistant", {1})), HasSubstr("4 coefficients"));
}

// Photos every 0.1 s for 10 s: 5 s straight on at 1 m/s, then 5 s of turning on
// the spot by 90 degrees.
BagLogs Drive() {
  BagLogs logs;
  logs.wheel_type = WheelType::kVelocity;
  for (int i = 0; i <= 100; ++i) {
    const timestamp_t time_ns = kStartNs + i * 100'000'000ll;
    logs.image_times_ns.push_back(time_ns);
    logs.wheel.push_back(
        {time_ns, i <= 50 ? 1.0 : 0.0, i <= 50 ? 0.0 : 0.5 * M_PI / 5.0});
  }
  return logs;
}

TEST(SelectPhotos, ByStepAndByDistanceDriven) {
  PhotoSelectionOptions options;
  EXPECT_EQ(SelectPhotos(Drive(), options)->size(), 101);
  options.image_step = 10;
  EXPECT_EQ(SelectPhotos(Drive(), options)->size(), 11);
  options.image_step = 1;
  options.image_distance_m = 0.99;
  // One at the start, five on the way, and one for each 10 degrees of the turn.
  const int num_photos = SelectPhotos(Drive(), options)->size();
  EXPECT_GE(num_photos, 6 + 7);
  EXPECT_LE(num_photos, 6 + 9);
  for (const WheelType type : {WheelType::kTicks, WheelType::kEncoder}) {
    BagLogs ticks = Drive();
    ticks.wheel_type = type;
    EXPECT_THAT(SelectPhotos(ticks, options).status().message(),
                HasSubstr("--image_step"));
  }
}

// The same drive in other wheel logs: two speeds of wheels 0.6 m apart, one
// speed, or a steering angle (without effect at rest). The distance is the
// same, and turns are never underestimated.
TEST(SelectPhotos, WheelsOfEachKind) {
  PhotoSelectionOptions options;
  options.image_distance_m = 0.99;
  const BagLogs drive = Drive();
  const auto count = [&](WheelType type, const auto& convert) {
    BagLogs logs = drive;
    logs.wheel_type = type;
    for (WheelSample& sample : logs.wheel) convert(&sample);
    return SelectPhotos(logs, options)->size();
  };
  EXPECT_GE(count(WheelType::kDifferential,
                  [](WheelSample* sample) {
                    const double half = 0.3 * sample->second;
                    *sample = {sample->timestamp_ns, sample->first - half,
                               sample->first + half};
                  }),
            6 + 7);
  EXPECT_EQ(count(WheelType::kSpeed,
                  [](WheelSample* sample) { sample->second = 1e6; }),
            6);
  EXPECT_EQ(count(WheelType::kSteering,
                  [](WheelSample* sample) { sample->second = 0.0; }),
            6);
  // 11.8 degrees between photos with a wheelbase of 0.5 m: each is selected.
  EXPECT_EQ(count(WheelType::kSteering,
                  [](WheelSample* sample) { sample->second = -0.8; }),
            51);
}

}  // namespace
}  // namespace adasfm
