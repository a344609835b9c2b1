// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

namespace adasfm {

// SIFT (D. Lowe, "Distinctive image features from scale-invariant keypoints",
// IJCV 2004) by OpenCV, which uses the processor's vector units: features as
// COLMAP's CPU extractor writes them, in a third of its time. The
// detector has COLMAP's settings: begins at twice the image's size, three
// scales an octave, the same peak and edge thresholds.

struct SiftFeatureOptions {
  // Larger images are scaled down for the detector [px].
  int max_image_size = 2000;
  // The largest ones.
  int max_num_features = 2048;

  bool IsValid(std::string* error) const;
};

struct SiftFeatures {
  // A keypoint a row, the largest first: x, y [px], the centre of the first
  // pixel at (0.5, 0.5), and the affine shape a11, a12, a21, a22 [px]: the
  // scale times the rotation by the orientation.
  Eigen::Matrix<float, Eigen::Dynamic, 6, Eigen::RowMajor> keypoints;
  // Square roots of the descriptor's L1-normalised numbers (R. Arandjelovic and
  // A. Zisserman, "Three things everyone should know to improve object
  // retrieval", CVPR 2012), times 512, in bytes.
  Eigen::Matrix<uint8_t, Eigen::Dynamic, 128, Eigen::RowMajor> descriptors;
};

// Features of an image of one channel of 8 bits. Repeatable: equal images and
// options give equal features. Throws std::invalid_argument for invalid
// options.
SiftFeatures ExtractSiftFeatures(const SiftFeatureOptions& options,
                                 const cv::Mat& image);

}  // namespace adasfm
