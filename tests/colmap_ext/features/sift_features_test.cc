// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/features/sift_features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "colmap_ext/matching/match_descriptors.h"

namespace adasfm {
namespace {

// A bright spot of Gaussian shape; (x, y) counts from the corner of the first
// pixel, as COLMAP's keypoints do.
void DrawSpot(double x, double y, double sigma, cv::Mat* image) {
  for (int row = 0; row < image->rows; ++row) {
    for (int column = 0; column < image->cols; ++column) {
      const double dx = column + 0.5 - x;
      const double dy = row + 0.5 - y;
      uint8_t& pixel = image->at<uint8_t>(row, column);
      pixel = cv::saturate_cast<uint8_t>(
          pixel +
          150.0 * std::exp(-(dx * dx + dy * dy) / (2.0 * sigma * sigma)));
    }
  }
}

// Spots at random places, of random sizes.
cv::Mat SpottedImage(int num_spots, int seed) {
  cv::Mat image(300, 400, CV_8UC1, cv::Scalar(40));
  cv::RNG random(seed);
  for (int i = 0; i < num_spots; ++i) {
    DrawSpot(random.uniform(20.0, 380.0), random.uniform(20.0, 280.0),
             random.uniform(1.5, 6.0), &image);
  }
  return image;
}

// Blurred noise: patterns with a direction, which round spots have not.
cv::Mat NoiseImage(int seed) {
  cv::Mat noise(300, 400, CV_32FC1);
  cv::RNG(seed).fill(noise, cv::RNG::UNIFORM, 0.0, 1.0);
  cv::GaussianBlur(noise, noise, cv::Size(), 3.0);
  cv::Mat image;
  cv::normalize(noise, image, 0.0, 255.0, cv::NORM_MINMAX, CV_8UC1);
  return image;
}

// A Gaussian spot has its strongest response in a difference of Gaussians at
// the scale of its own sigma; 8 bits and three scales an octave leave an error
// of a tenth.
TEST(SiftFeatures, KeypointsAreWhereTheSpotsAre) {
  for (const double sigma : {2.0, 3.0, 5.0}) {
    for (const double shift : {0.0, 0.3, 0.7}) {
      cv::Mat image(200, 240, CV_8UC1, cv::Scalar(40));
      const double x = 120.0 + shift, y = 90.5 - shift;
      DrawSpot(x, y, sigma, &image);
      const SiftFeatures features =
          ExtractSiftFeatures(SiftFeatureOptions(), image);
      ASSERT_GT(features.keypoints.rows(), 0);
      const auto keypoint = features.keypoints.row(0);
      EXPECT_NEAR(keypoint(0), x, 0.05);
      EXPECT_NEAR(keypoint(1), y, 0.05);
      EXPECT_NEAR(std::hypot(keypoint(2), keypoint(4)), sigma, 0.15 * sigma);
    }
  }
}

TEST(SiftFeatures, ALargerImageIsScaledDownAndItsKeypointsBack) {
  cv::Mat image(800, 1000, CV_8UC1, cv::Scalar(40));
  DrawSpot(612.4, 333.1, 12.0, &image);
  SiftFeatureOptions options;
  options.max_image_size = 500;
  const SiftFeatures features = ExtractSiftFeatures(options, image);
  ASSERT_GT(features.keypoints.rows(), 0);
  EXPECT_NEAR(features.keypoints(0, 0), 612.4, 0.1);
  EXPECT_NEAR(features.keypoints(0, 1), 333.1, 0.1);
  EXPECT_NEAR(std::hypot(features.keypoints(0, 2), features.keypoints(0, 4)),
              12.0, 1.8);
}

TEST(SiftFeatures, TheLargestAreKeptInOrder) {
  const cv::Mat image = SpottedImage(200, 1);
  const SiftFeatures all = ExtractSiftFeatures(SiftFeatureOptions(), image);
  SiftFeatureOptions options;
  options.max_num_features = 50;
  const SiftFeatures largest = ExtractSiftFeatures(options, image);
  ASSERT_GT(all.keypoints.rows(), 100);
  ASSERT_EQ(largest.keypoints.rows(), 50);
  EXPECT_EQ(largest.keypoints, all.keypoints.topRows(50));
  EXPECT_EQ(largest.descriptors, all.descriptors.topRows(50));
  for (int i = 1; i < all.keypoints.rows(); ++i) {
    EXPECT_LE(all.keypoints.row(i).tail<4>().norm(),
              all.keypoints.row(i - 1).tail<4>().norm() * 1.0001);
  }
}

// RootSIFT is a vector of length one, times 512, rounded.
TEST(SiftFeatures, DescriptorsHaveTheLengthOfRootSift) {
  const SiftFeatures features =
      ExtractSiftFeatures(SiftFeatureOptions(), SpottedImage(200, 2));
  ASSERT_GT(features.descriptors.rows(), 100);
  for (int i = 0; i < features.descriptors.rows(); ++i) {
    EXPECT_NEAR(features.descriptors.row(i).cast<double>().norm(), 512.0, 8.0);
  }
}

// Rotating the image by 90 deg rotates the orientations and leaves the
// descriptors unchanged: each keypoint matches its rotated counterpart.
TEST(SiftFeatures, ATurnedImageGivesTurnedKeypoints) {
  const cv::Mat image = NoiseImage(3);
  cv::Mat turned;
  cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
  const SiftFeatures before = ExtractSiftFeatures(SiftFeatureOptions(), image);
  const SiftFeatures after = ExtractSiftFeatures(SiftFeatureOptions(), turned);
  const std::vector<FeatureMatch> matches =
      MatchDescriptors(DescriptorMatchingOptions(), before.descriptors.data(),
                       before.descriptors.rows(), after.descriptors.data(),
                       after.descriptors.rows());
  ASSERT_GT(matches.size(), 100u);
  size_t num_turned = 0;
  for (const FeatureMatch& match : matches) {
    const auto keypoint1 = before.keypoints.row(match.point2D_idx1);
    const auto keypoint2 = after.keypoints.row(match.point2D_idx2);
    // x to the right and y down: clockwise takes (x, y) to (rows - y, x), and
    // a direction (cos, sin) to (-sin, cos).
    const bool same_place =
        std::abs(keypoint2(0) - (image.rows - keypoint1(1))) < 0.5 &&
        std::abs(keypoint2(1) - keypoint1(0)) < 0.5;
    const double cosine =
        (-keypoint1(4) * keypoint2(2) + keypoint1(2) * keypoint2(4)) /
        (std::hypot(keypoint1(2), keypoint1(4)) *
         std::hypot(keypoint2(2), keypoint2(4)));
    num_turned += same_place && cosine > std::cos(0.1);
  }
  EXPECT_GT(num_turned, 0.9 * matches.size());
}

TEST(SiftFeatures, AnImageOfNothingHasNone) {
  const SiftFeatures features = ExtractSiftFeatures(
      SiftFeatureOptions(), cv::Mat(100, 100, CV_8UC1, cv::Scalar(90)));
  EXPECT_EQ(features.keypoints.rows(), 0);
  EXPECT_EQ(features.descriptors.rows(), 0);
}

TEST(SiftFeatures, OptionsAreChecked) {
  SiftFeatureOptions options;
  options.max_num_features = 0;
  EXPECT_THROW(
      ExtractSiftFeatures(options, cv::Mat(10, 10, CV_8UC1, cv::Scalar(0))),
      std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
