// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/v3/verify_prediction.h"

#include <base/homography_matrix.h>
#include <estimators/homography_matrix.h>
#include <estimators/utils.h>
#include <optim/loransac.h>

#include <algorithm>

#include "colmap_ext/host/camera.h"
#include "core/so3.h"
#include "global/two_view/minimize_epipolar_distances.h"

namespace adasfm {
namespace {

// Enough, since the start is close to the solution.
constexpr size_t kMaxNumUsedMatches = 200;
// 1 sigma of a keypoint, relative to which the prediction is weighted.
constexpr double kKeypointSigmaPx = 1.0;
constexpr double kMinInlierRatio = 0.5;

std::vector<Bearing> ComputeEvenBearings(
    const colmap::Camera& camera, const std::vector<Eigen::Vector2d>& pixels) {
  const size_t count = std::min(pixels.size(), kMaxNumUsedMatches);
  std::vector<Eigen::Vector2d> used;
  for (size_t k = 0; k < count; ++k) {
    used.push_back(pixels[k * pixels.size() / count]);
  }
  return ComputeBearings(camera, used);
}

TwoViewPose RefinePose(const PredictedMotion& prediction,
                       const colmap::Camera& camera1,
                       const colmap::Camera& camera2,
                       const MatchedPoints& points) {
  const std::vector<Bearing> bearings1 =
      ComputeEvenBearings(camera1, points.pixels1);
  const std::vector<Bearing> bearings2 =
      ComputeEvenBearings(camera2, points.pixels2);
  EdgeBearings bearings;
  for (size_t k = 0; k < bearings1.size(); ++k) {
    bearings.bearings1.push_back(&bearings1[k]);
    bearings.bearings2.push_back(&bearings2[k]);
  }
  TwoViewPose start;
  start.rotation = prediction.cam2_from_cam1.rotation.toRotationMatrix();
  start.translation = prediction.cam2_from_cam1.translation.normalized();
  EpipolarMinimization minimization;
  minimization.prediction.rotation = start.rotation;
  minimization.prediction.information =
      kKeypointSigmaPx * kKeypointSigmaPx *
      prediction.covariance.topLeftCorner<3, 3>().inverse();
  return MinimizeEpipolarDistances(minimization, bearings, start).pose;
}

}  // namespace

std::optional<colmap::TwoViewGeometry> VerifyPrediction(
    const colmap::TwoViewGeometry::Options& options,
    const PredictedMotion& prediction, const colmap::Camera& camera1,
    const colmap::Camera& camera2, const colmap::FeatureMatches& matches,
    const MatchedPoints& points) {
  if (matches.size() < options.min_num_inliers ||
      prediction.cam2_from_cam1.translation.isZero()) {
    return std::nullopt;
  }
  const TwoViewPose pose = RefinePose(prediction, camera1, camera2, points);
  colmap::TwoViewGeometry geometry;
  geometry.E = Hat(pose.translation) * pose.rotation;
  geometry.F = camera2.CalibrationMatrix().inverse().transpose() * geometry.E *
               camera1.CalibrationMatrix().inverse();
  const double max_error_px = options.ransac_options.max_error;
  const double max_error = (camera1.ImageToWorldThreshold(max_error_px) +
                            camera2.ImageToWorldThreshold(max_error_px)) /
                           2.0;
  std::vector<double> squared_errors;
  colmap::ComputeSquaredSampsonError(points.points1, points.points2, geometry.E,
                                     &squared_errors);
  for (size_t i = 0; i < matches.size(); ++i) {
    if (squared_errors[i] <= max_error * max_error) {
      geometry.inlier_matches.push_back(matches[i]);
    }
  }
  const size_t num_inliers = geometry.inlier_matches.size();
  if (num_inliers < options.min_num_inliers ||
      num_inliers < kMinInlierRatio * matches.size()) {
    return std::nullopt;
  }
  // A homography matters only when it has at least this share of the inliers.
  colmap::RANSACOptions ransac = options.ransac_options;
  ransac.min_inlier_ratio =
      std::max(ransac.min_inlier_ratio, options.max_H_inlier_ratio *
                                            static_cast<double>(num_inliers) /
                                            matches.size());
  colmap::LORANSAC<colmap::HomographyMatrixEstimator,
                   colmap::HomographyMatrixEstimator>
      estimator(ransac);
  const auto homography = estimator.Estimate(points.pixels1, points.pixels2);
  geometry.H = homography.model;
  geometry.config =
      homography.success && homography.support.num_inliers >
                                options.max_H_inlier_ratio * num_inliers
          ? colmap::TwoViewGeometry::PLANAR_OR_PANORAMIC
          : colmap::TwoViewGeometry::CALIBRATED;
  return geometry;
}

}  // namespace adasfm
