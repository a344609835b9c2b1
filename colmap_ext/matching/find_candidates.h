// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "colmap_ext/matching/motion_prediction.h"

namespace adasfm {

// Keypoints on the plane z = 1 of their camera, without distortion.
struct PlaneKeypoints {
  std::vector<Eigen::Vector2d> points;
  // Size of one pixel on this plane.
  double pixel_size = 1.0;
};

// For each keypoint of image 1, those of image 2 that can show the same point.
struct MatchCandidates {
  // Keypoint i has the indices from begins[i] to before begins[i + 1].
  std::vector<int> begins;
  std::vector<int> indices;
};

// Finds where the predicted motion puts the points of image 1 in image 2: near
// their epipolar lines, between the image of a point at infinity and that of a
// point at a distance of the baseline length, but at least half a metre. SIFT
// does not match nearer points, since their viewing directions differ too much.
// Method: the prediction's covariance is propagated to the image at both ends
// of the line. The effect of the rotation's error is constant along the line,
// that of the translation's error grows in proportion to the distance from
// infinity; so the band widens linearly. The keypoints of image 2 are compared
// with the band in blocks of neighbours.
// False where the prediction does not help: when more than a tenth of all pairs
// of keypoints are candidates, or when more than half of the keypoints would
// lie behind camera 2.
bool FindCandidates(const PredictedMotion& prediction,
                    const PlaneKeypoints& keypoints1,
                    const PlaneKeypoints& keypoints2,
                    MatchCandidates* candidates);

}  // namespace adasfm
