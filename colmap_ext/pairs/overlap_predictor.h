// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/host/camera.h"
#include "core/status.h"
#include "core/types.h"
#include "global/odometry/odometry_chain.h"

namespace adasfm {

struct OverlapPredictionOptions {
  // If false, nothing is predicted.
  bool enabled = true;
  // Typical distance of what the photos show. Overlap is predicted for points
  // at 0.25 to 4 times this distance. Images further apart than 2.5 times share
  // nothing that SIFT matches (kitti07-160: 98 % of the pairs verify 30 to 50 m
  // apart, 2 % beyond).
  double scene_depth_m = 20.0;
  // Pairs with a smaller overlap are not worth matching. On kitti07-160, of the
  // pairs with at least 60 matches, 0.15 loses 0.2 %, 0.2 loses 3 %, and 0.25
  // loses 9 %.
  double min_overlap = 0.15;
  OdometryChainOptions chain;

  // The uncertainty of the extrinsics is already in the sigmas of the
  // smoother's steps, which persist along the chain; here it is not added a
  // second time. Scales of the gyroscope, which most drives do not have wrong,
  // would cost most of the pairs that odometry saves. The gate of loops, which
  // must not reject a true loop, is more conservative.
  OverlapPredictionOptions() {
    chain.gyro_scale_sigma = 0.0;
    chain.extrinsic_rotation_sigma_rad = 0.0;
    chain.driving_direction_sigma_rad = 0.0;
  }

  bool IsValid(std::string* error) const;
};

// Predicts how much of their views images share, from the priors in the
// database, before anything is matched.
// Inputs: relative pose priors with covariance, and the cameras.
// Method: the chain of priors gives the motion between two images with its
// covariance. Points on a grid of pixels and depths of one image are projected
// into the other. A point is shared if it is in view, at 0.4 to 2.5 times the
// distance, with less than 40 degrees between its rays: the limits of SIFT. The
// overlap is the ratio of shared points, the smaller one of the two images. It
// is 0 for images that are too far apart, in position or viewing direction,
// even within 3 sigma of the odometry.
class OverlapPredictor {
 public:
  // Predicts nothing.
  OverlapPredictor() = default;

  // An error for a database or priors that cannot be read.
  static StatusOr<OverlapPredictor> Read(
      const OverlapPredictionOptions& options,
      const std::string& database_path);

  // None where the odometry is uncertain: no chain of priors with rotation and
  // length connects the images, or its 3 sigma exceed the distance of the
  // nearest points, or 10 degrees. Thread-safe.
  std::optional<double> Predict(const ImagePair& pair) const;

  // Whether there are priors for predictions.
  bool HasOdometry() const { return !chain_.empty(); }

 private:
  // View of the images of one camera.
  struct View {
    colmap::Camera camera;
    std::vector<Eigen::Vector3d> points_in_cam;
    // The greatest angle between the optical axis and a ray [rad].
    double half_angle = 0.0;
  };
  static View BuildView(const colmap::Camera& camera, double scene_depth_m);
  static double SharedPart(const View& view1, const View& view2,
                           const Rigid3d& cam2_from_cam1);
  const View& ViewOf(image_t image_id) const {
    return views_.at(camera_ids_.at(image_id));
  }

  OverlapPredictionOptions options_;
  OdometryChain chain_;
  std::map<image_t, camera_t> camera_ids_;
  std::map<camera_t, View> views_;
};

}  // namespace adasfm
