// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/features/sift_features.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <tuple>
#include <vector>

namespace adasfm {
namespace {

// COLMAP's defaults (SiftExtractionOptions). OpenCV divides the contrast
// threshold by the number of scales, which gives COLMAP's peak threshold.
constexpr int kScalesPerOctave = 3;
constexpr double kContrastThreshold = 0.02;
constexpr double kEdgeThreshold = 10.0;
constexpr double kFirstSigma = 1.6;
// OpenCV's coordinates start at the centre of the first pixel, COLMAP's at its
// corner. OpenCV's doubled image is shifted by a quarter of a pixel: pixel x of
// the image is at 2 x + 0.5, but OpenCV only halves keypoint positions.
constexpr float kCenterFromCorner = 0.5F;
constexpr float kDoublingShift = -0.25F;
// OpenCV gives the diameter at one sigma.
constexpr float kScaleFromSize = 0.5F;
constexpr float kDescriptorFactor = 512.0F;

// Scales the image down to max_image_size. Returns the factors, for x and y,
// from its pixels to those of the original image.
Eigen::Vector2f LimitSize(int max_image_size, cv::Mat* image) {
  const int larger = std::max(image->cols, image->rows);
  if (larger <= max_image_size) return Eigen::Vector2f::Ones();
  const double factor = static_cast<double>(max_image_size) / larger;
  const cv::Size size(std::max(1, static_cast<int>(image->cols * factor)),
                      std::max(1, static_cast<int>(image->rows * factor)));
  const Eigen::Vector2f scale(static_cast<float>(image->cols) / size.width,
                              static_cast<float>(image->rows) / size.height);
  cv::Mat resized;
  cv::resize(*image, resized, size, 0.0, 0.0, cv::INTER_AREA);
  *image = resized;
  return scale;
}

// Indices of the largest keypoints, the largest first; the order of equal sizes
// does not depend on the detector's threads.
std::vector<size_t> FindLargest(const std::vector<cv::KeyPoint>& keypoints,
                                size_t max_count) {
  const auto key = [&keypoints](size_t i) {
    const cv::KeyPoint& keypoint = keypoints[i];
    return std::make_tuple(-keypoint.size, keypoint.pt.y, keypoint.pt.x,
                           keypoint.angle);
  };
  std::vector<size_t> indices(keypoints.size());
  std::iota(indices.begin(), indices.end(), 0);
  std::sort(indices.begin(), indices.end(),
            [&key](size_t a, size_t b) { return key(a) < key(b); });
  if (indices.size() > max_count) indices.resize(max_count);
  return indices;
}

void WriteKeypoint(
    const cv::KeyPoint& keypoint, const Eigen::Vector2f& scale,
    Eigen::Ref<Eigen::Matrix<float, 1, 6, Eigen::RowMajor>> row) {
  constexpr float kOffset = kCenterFromCorner + kDoublingShift;
  const float sigma = kScaleFromSize * keypoint.size * scale.mean();
  const float angle = keypoint.angle * static_cast<float>(M_PI / 180.0);
  row << (keypoint.pt.x + kOffset) * scale.x(),
      (keypoint.pt.y + kOffset) * scale.y(), sigma * std::cos(angle),
      -sigma * std::sin(angle), sigma * std::sin(angle),
      sigma * std::cos(angle);
}

}  // namespace

bool SiftFeatureOptions::IsValid(std::string* error) const {
  if (max_image_size < 1) {
    *error = "max_image_size = " + std::to_string(max_image_size) +
             " must be positive";
  } else if (max_num_features < 1) {
    *error = "max_num_features = " + std::to_string(max_num_features) +
             " must be positive";
  } else {
    return true;
  }
  return false;
}

SiftFeatures ExtractSiftFeatures(const SiftFeatureOptions& options,
                                 const cv::Mat& image) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  cv::Mat limited = image;
  const Eigen::Vector2f scale = LimitSize(options.max_image_size, &limited);
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create(
      /*nfeatures=*/0, kScalesPerOctave, kContrastThreshold, kEdgeThreshold,
      kFirstSigma);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat numbers;
  sift->detectAndCompute(limited, cv::noArray(), keypoints, numbers);
  const std::vector<size_t> largest =
      FindLargest(keypoints, options.max_num_features);

  SiftFeatures features;
  features.keypoints.resize(largest.size(), Eigen::NoChange);
  features.descriptors.resize(largest.size(), Eigen::NoChange);
  for (size_t i = 0; i < largest.size(); ++i) {
    WriteKeypoint(keypoints[largest[i]], scale, features.keypoints.row(i));
    const Eigen::Map<const Eigen::Matrix<float, 1, 128>> descriptor(
        numbers.ptr<float>(largest[i]));
    const float sum = std::max(descriptor.sum(), 1.0F);
    features.descriptors.row(i) =
        (descriptor / sum)
            .cwiseSqrt()
            .unaryExpr([](float number) {
              return std::min(std::round(kDescriptorFactor * number), 255.0F);
            })
            .cast<uint8_t>();
  }
  return features;
}

}  // namespace adasfm
