// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

namespace adasfm {

// SIFT (D. Lowe, "Distinctive image features from scale-invariant keypoints",
// IJCV 2004) by OpenCV, which uses the processor's vector units. The features
// have the format of COLMAP's CPU extractor and take a third of its time. The
// detector has COLMAP's settings: it starts at twice the image's size, with
// three scales per octave and the same peak and edge thresholds.

struct SiftFeatureOptions {
  // Larger images are scaled down for the detector [px].
  int max_image_size = 2000;
  // The largest features are kept.
  int max_num_features = 2048;

  bool IsValid(std::string* error) const;
};

struct SiftFeatures {
  // One keypoint per row, the largest first: x, y [px], with the centre of the
  // first pixel at (0.5, 0.5), and the affine shape a11, a12, a21, a22 [px]:
  // scale times rotation by the orientation.
  Eigen::Matrix<float, Eigen::Dynamic, 6, Eigen::RowMajor> keypoints;
  // Square roots of the descriptor's L1-normalised numbers (R. Arandjelovic and
  // A. Zisserman, "Three things everyone should know to improve object
  // retrieval", CVPR 2012), times 512, as bytes.
  Eigen::Matrix<uint8_t, Eigen::Dynamic, 128, Eigen::RowMajor> descriptors;
};

// Extracts features of an 8-bit image with one channel. Equal images and
// options give equal features. Throws std::invalid_argument for invalid
// options.
SiftFeatures ExtractSiftFeatures(const SiftFeatureOptions& options,
                                 const cv::Mat& image);

}  // namespace adasfm
