// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/camera.h>
#include <estimators/pose.h>

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/rigid3d.h"

namespace adasfm {

// Keypoints of one image (pixels) and the points that they see (world).
struct PointsInImage {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> points_in_world;
};

// The pose by P3P and RANSAC; none when no sample explains any points.
inline std::optional<Rigid3d> EstimatePoseByP3p(const PointsInImage& points,
                                                const colmap::Camera& camera,
                                                double max_error_px) {
  colmap::AbsolutePoseEstimationOptions options;
  options.num_threads = 1;
  options.ransac_options.max_error = max_error_px;
  options.ransac_options.min_inlier_ratio = 0.2;
  options.ransac_options.min_num_trials = 30;
  options.ransac_options.max_num_trials = 2000;
  options.ransac_options.confidence = 0.9999;
  colmap::Camera fixed_camera = camera;
  Eigen::Vector4d qvec;
  Eigen::Vector3d tvec;
  size_t num_inliers = 0;
  std::vector<char> inlier_mask;
  if (!colmap::EstimateAbsolutePose(
          options, points.pixels, points.points_in_world, &qvec, &tvec,
          &fixed_camera, &num_inliers, &inlier_mask)) {
    return std::nullopt;
  }
  return Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
}

// Minimises the reprojection errors of the points in the mask, robustly. The
// pose stays as it was when the solver fails.
inline void RefinePose(const PointsInImage& points,
                       const std::vector<char>& inlier_mask,
                       const colmap::Camera& camera, Rigid3d* cam_from_world) {
  colmap::AbsolutePoseRefinementOptions options;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  options.print_summary = false;
  options.max_num_iterations = 20;
  options.gradient_tolerance = 10.0;
  colmap::Camera fixed_camera = camera;
  const Eigen::Quaterniond& rotation = cam_from_world->rotation;
  Eigen::Vector4d qvec(rotation.w(), rotation.x(), rotation.y(), rotation.z());
  Eigen::Vector3d tvec = cam_from_world->translation;
  if (!colmap::RefineAbsolutePose(options, inlier_mask, points.pixels,
                                  points.points_in_world, &qvec, &tvec,
                                  &fixed_camera) ||
      !qvec.allFinite() || !tvec.allFinite()) {
    return;
  }
  *cam_from_world =
      Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
}

}  // namespace adasfm
