// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

struct InertialOdometry {
  // The input's, with translations in metres where these are known.
  std::vector<RelativePosePrior> priors;
  // The covariances (m^2, in the axes of camera 2) of translations across gaps,
  // which only the accelerometer tells.
  std::map<ImagePair, Eigen::Matrix3d> bridges;
  int num_gaps = 0;  // bridged
};

// What: the odometry of a drive without wheels, from models that vision left in
// parts where images saw nothing. Within a model vision tells the way between
// two images, and the accelerometer its size; across a gap the velocities on
// both sides and the accelerometer tell it.
//
// Inputs: motions of consecutive images in order of time; priors in the same
// camera frame, whose rotations lead across gaps; poses of each model, in a
// unit of its own. At least one's size the accelerometer must tell by itself
// (EstimateInertialScale); that of others is found across gaps.
// Method. For each gap a linear smoother over some seconds on both sides:
// positions and velocities of all images, gravity, bias of the accelerometer
// place and size of the sides, from the models' positions and what the IMU
// integrated, whose white noise includes what the axes' scales and the tilts
// err by. Covariances grow with the residuals' chi-square. All steps of a gap
// err as one: each gets its share, by time, of the covariance of the whole.
InertialOdometry BridgeGaps(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<std::map<image_t, Rigid3d>>& models);

}  // namespace adasfm
