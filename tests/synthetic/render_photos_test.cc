// SPDX-License-Identifier: BSD-3-Clause
// Effects of a photo's settings on its grey levels.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "synthetic/render_world.h"

namespace adasfm {
namespace {

constexpr size_t kIndex = 6;

SyntheticWorld BuildSmallWorld(double exposure_time_s = 0.0) {
  SyntheticWorldOptions options;
  options.num_images = 12;
  options.image_width = 320;
  options.image_height = 200;
  options.num_keypoints_per_image = 60;
  options.exposure_time_s = exposure_time_s;
  return BuildSyntheticWorld(options);
}

cv::Mat RenderGrey(WorldRenderer* renderer) {
  cv::Mat grey;
  cv::cvtColor(renderer->Render(kIndex), grey, cv::COLOR_BGR2GRAY);
  grey.convertTo(grey, CV_32F);
  return grey;
}

double MeanDifference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / a.total();
}

double GradientEnergy(const cv::Mat& grey) {
  cv::Mat smooth, dx, dy;
  cv::GaussianBlur(grey, smooth, cv::Size(0, 0), 1.0);  // without the noise
  cv::Sobel(smooth, dx, CV_32F, 1, 0);
  cv::Sobel(smooth, dy, CV_32F, 0, 1);
  return dx.dot(dx) + dy.dot(dy);
}

TEST(WorldRenderer, BrightnessFollowsTheGainUpToWhite) {
  SyntheticWorld world = BuildSmallWorld();
  WorldRenderer renderer(world);
  const cv::Mat photo = renderer.Render(kIndex);
  for (const double gain : {0.25, 0.5, 1.5, 3.0}) {
    world.images[kIndex].exposure_gain = gain;
    const cv::Mat other = renderer.Render(kIndex);
    double expected = 0.0;
    int num_white = 0;
    for (int y = 0; y < photo.rows; ++y) {
      for (int x = 0; x < photo.cols; ++x) {
        const double level = gain * photo.at<cv::Vec3b>(y, x)[1];
        expected += std::min(255.0, level) / photo.total();
        num_white += level > 270.0;
        if (level > 270.0) {
          EXPECT_GT(other.at<cv::Vec3b>(y, x)[1], 245);
        }
      }
    }
    EXPECT_EQ(num_white > 100, gain > 1.0);
    EXPECT_NEAR(cv::mean(other)[1], expected, 1.0);
  }
}

TEST(WorldRenderer, MotionBlurLowersGradientsAndKeepsTheMean) {
  SyntheticWorld world = BuildSmallWorld();
  WorldRenderer renderer(world);
  const cv::Mat sharp = RenderGrey(&renderer);
  double last_energy = GradientEnergy(sharp);
  for (const double time_s : {0.02, 0.05, 0.1}) {
    world.images[kIndex].shutter =
        BuildSmallWorld(time_s).images[kIndex].shutter;
    const cv::Mat blurred = RenderGrey(&renderer);
    EXPECT_NEAR(cv::mean(blurred)[0], cv::mean(sharp)[0], 1.0);
    const double energy = GradientEnergy(blurred);
    EXPECT_LT(energy, 0.95 * last_energy);
    last_energy = energy;
  }
  EXPECT_LT(last_energy, 0.6 * GradientEnergy(sharp));
}

// Reference: the mean of sharp photos along the camera's path.
TEST(WorldRenderer, BlurredPhotoIsTheMeanOfSharpOnes) {
  SyntheticWorld world = BuildSmallWorld(0.1);
  WorldRenderer renderer(world);
  const cv::Mat blurred = RenderGrey(&renderer);
  const ExposurePoses shutter = *world.images[kIndex].shutter;
  const Rigid3d middle = world.images[kIndex].cam_from_world;
  world.images[kIndex].shutter.reset();
  cv::Mat mean = cv::Mat::zeros(blurred.size(), CV_32F);
  constexpr int kNumPhotos = 30;
  for (int i = 0; i < kNumPhotos; ++i) {
    world.images[kIndex].cam_from_world =
        shutter.CamFromWorldAt((i + 0.5) / kNumPhotos);
    mean += RenderGrey(&renderer) / kNumPhotos;
  }
  world.images[kIndex].cam_from_world = middle;
  // All photos of an image have the same noise. The remaining difference comes
  // from sums over different moments and from rounding.
  EXPECT_LT(MeanDifference(blurred, mean), 0.5);
  EXPECT_GT(MeanDifference(RenderGrey(&renderer), mean), 2.0);
}

TEST(WorldRenderer, FocalLengthScalesThePhotoAboutItsPrincipalPoint) {
  SyntheticWorld world = BuildSmallWorld();
  WorldRenderer renderer(world);
  const cv::Mat photo = RenderGrey(&renderer);
  constexpr double kFactor = 1.05;
  world.images[kIndex].focal_factor = kFactor;
  const cv::Mat other = RenderGrey(&renderer);
  // The principal point (160, 100) lies between pixels 159 and 160.
  const cv::Mat map =
      (cv::Mat_<double>(2, 3) << kFactor, 0.0, 159.5 * (1.0 - kFactor), 0.0,
       kFactor, 99.5 * (1.0 - kFactor));
  cv::Mat scaled;
  cv::warpAffine(photo, scaled, map, photo.size());
  EXPECT_LT(MeanDifference(other, scaled), 4.0);
  EXPECT_GT(MeanDifference(other, photo), 2.0 * MeanDifference(other, scaled));
}

}  // namespace
}  // namespace adasfm
