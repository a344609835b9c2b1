// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/camera.h>
#include <estimators/two_view_geometry.h>

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "colmap_ext/matching/motion_prediction.h"

namespace adasfm {

// One keypoint per image and match, as pixel and on the plane z = 1.
struct MatchedPoints {
  std::vector<Eigen::Vector2d> pixels1, pixels2;
  std::vector<Eigen::Vector2d> points1, points2;
};

// Finds the two-view geometry near a predicted motion, in place of COLMAP's
// RANSAC search: minimises the robust epipolar distances, starting at the
// prediction, with the prediction's covariance as a constraint on the rotation.
// Inliers, thresholds and the decision between CALIBRATED and
// PLANAR_OR_PANORAMIC are COLMAP's (TwoViewGeometry::EstimateCalibrated).
// None with fewer than options.min_num_inliers inliers, or where less than half
// of the matches agree: the true motion may then be another one.
std::optional<colmap::TwoViewGeometry> VerifyPrediction(
    const colmap::TwoViewGeometry::Options& options,
    const PredictedMotion& prediction, const colmap::Camera& camera1,
    const colmap::Camera& camera2, const colmap::FeatureMatches& matches,
    const MatchedPoints& points);

}  // namespace adasfm
