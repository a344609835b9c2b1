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
  // Otherwise nothing is predicted.
  bool enabled = true;
  // How far away what the photos show typically is. Overlap is predicted for
  // points at a quarter of it to four times it. Images further apart than 2.5
  // times it share nothing that SIFT matches (kitti07-160: 98 % of the pairs
  // verify 30 to 50 m apart, 2 % beyond).
  double scene_depth_m = 20.0;
  // Pairs that share less of their views are not worth matching. At 0.15
  // kitti07-160 keeps all but 0.2 % of the pairs with at least 60 matches, at
  // 0.2 all but 3 %, at 0.25 all but 9 %.
  double min_overlap = 0.15;
  OdometryChainOptions chain;

  // What the smoother does not know of the mounting is in the sigmas of its
  // steps, which persist along the chain: here it does not count once more. The
  // gate of loops, which must not refuse a true one, is more careful.
  OverlapPredictionOptions() {
    chain.extrinsic_rotation_sigma_rad = 0.0;
    chain.driving_direction_sigma_rad = 0.0;
  }

  bool IsValid(std::string* error) const;
};

// How much of their views images share, by the priors in the database, before
// anything is matched.
// Inputs: relative pose priors with covariance, and the cameras.
// Method: the chain of priors gives the motion between two images with its
// covariance. Points on a grid of pixels and depths of one image are projected
// into the other; a point is shared where it is in view, at 0.4 to 2.5 times
// the distance, its rays less than 40 degrees apart: what SIFT bears. The
// overlap is the share of such points, of the two images the smaller one.
// It is 0 for images that, 3 sigma of the odometry granted, are too far apart
// or look too far apart.
class OverlapPredictor {
 public:
  // Predicts nothing.
  OverlapPredictor() = default;

  // An error for a database or priors that cannot be read.
  static StatusOr<OverlapPredictor> Read(
      const OverlapPredictionOptions& options,
      const std::string& database_path);

  // None where the odometry is not sure: no chain of priors with rotation and
  // length connects the images, or its 3 sigma are more than the nearest points
  // are away, or than 10 degrees. Safe on several threads.
  std::optional<double> Predict(const ImagePair& pair) const;

  // Whether there are priors to predict by.
  bool HasOdometry() const { return !chain_.empty(); }

 private:
  // What images of one camera see.
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
