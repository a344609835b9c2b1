// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/image_codecs.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

cv::Mat MakePicture() {
  cv::Mat picture(20, 30, CV_8UC3);
  cv::RNG random(1);
  random.fill(picture, cv::RNG::UNIFORM, 0, 256);
  return picture;
}

bool AreEqual(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() &&
         cv::norm(a, b, cv::NORM_INF) == 0.0;
}

TEST(ImageCodecsTest, EncodesAsTheLibraryItself) {
  const cv::Mat picture = MakePicture();
  for (const char* extension : {".png", ".jpg"}) {
    std::vector<unsigned char> expected;
    cv::imencode(extension, picture, expected);
    EXPECT_EQ(EncodeImage(extension, picture), expected);
  }
  EXPECT_LT(
      EncodeImage(".jpg", picture, {cv::IMWRITE_JPEG_QUALITY, 10}).size(),
      EncodeImage(".jpg", picture, {cv::IMWRITE_JPEG_QUALITY, 90}).size());
  EXPECT_THROW(EncodeImage(".unknown", picture), cv::Exception);
}

TEST(ImageCodecsTest, ReadsAsTheLibraryItself) {
  const TemporaryFolder folder;
  const std::string path = folder.File("picture.png");
  ASSERT_TRUE(cv::imwrite(path, MakePicture()));
  EXPECT_TRUE(AreEqual(ReadImageFile(path, cv::IMREAD_COLOR), MakePicture()));
  for (const int flags : {cv::IMREAD_GRAYSCALE, cv::IMREAD_REDUCED_COLOR_2}) {
    EXPECT_TRUE(AreEqual(ReadImageFile(path, flags), cv::imread(path, flags)));
  }
  EXPECT_TRUE(ReadImageFile(folder.File("none.png"), 0).empty());
}

}  // namespace
}  // namespace adasfm
