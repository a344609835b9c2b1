// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "colmap_ext/matching/motion_prediction.h"

namespace adasfm {

// Keypoints on the plane z = 1 of their camera, without distortion.
struct PlaneKeypoints {
  std::vector<Eigen::Vector2d> points;
  // Of one pixel.
  double pixel_size = 1.0;
};

// Of each keypoint of image 1 those of image 2 that can show the same point.
struct MatchCandidates {
  // Of keypoint i: indices[begins[i]] to before indices[begins[i + 1]].
  std::vector<int> begins;
  std::vector<int> indices;
};

struct CandidateOptions {
  // What keypoints and calibration are off the epipolar line, beside the
  // prediction [px]: COLMAP's limit for inliers.
  double max_error_px = 4.0;
  // Sigmas of the prediction that are granted.
  double num_sigmas = 3.0;
  // Candidates among all pairs of keypoints. Beyond, the prediction leaves too
  // much for its search to be faster.
  double max_share = 0.1;
};

// Where the predicted motion puts the points of image 1 in image 2: near their
// epipolar lines, and along these between the place of a point at infinity and
// that of one as near as the baseline is long, or half a metre. Nearer points
// are seen from directions too different for SIFT.
// Method: the prediction's covariance is carried to the image, at both ends of
// the line. What the rotation's error moves is the same along the line, what
// the translation's error moves is proportional to the way from infinity; so
// the band widens linearly. The keypoints of image 2 are compared with it in
// blocks of neighbours.
// False where the prediction is no help: for more candidates than max_share, or
// where more than half of the keypoints would lie behind camera 2.
bool FindCandidates(const CandidateOptions& options,
                    const PredictedMotion& prediction,
                    const PlaneKeypoints& keypoints1,
                    const PlaneKeypoints& keypoints2,
                    MatchCandidates* candidates);

}  // namespace adasfm
