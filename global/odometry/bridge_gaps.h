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
  // which the accelerometer alone determines.
  std::map<ImagePair, Eigen::Matrix3d> bridges;
  int num_gaps = 0;  // bridged
};

// Computes the odometry of a drive without wheels from models that vision left
// split where images see nothing. Within a model, vision determines the motion
// between two images, and the accelerometer its scale. Across a gap, the
// velocities on both sides and the accelerometer determine the motion.
//
// motions: of consecutive images in order of time. priors: in the same camera
// frame; their rotations are used across gaps. models: the poses of each model,
// in a unit of its own. The accelerometer must determine the scale of at least
// one model by itself (EstimateInertialScale); the others' is found across
// gaps.
//
// Each gap has a linear smoother over some seconds on both sides. Unknowns:
// positions and velocities of all images, gravity, bias of the accelerometer,
// place and scale of the sides. Observations: the models' positions and what
// the IMU integrated, whose white noise includes errors of the axes' scales and
// of the tilts. Covariances grow with the residuals' chi-square. All steps of a
// gap share one error: each gets its share, by time, of the covariance of the
// whole.
InertialOdometry BridgeGaps(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<std::map<image_t, Rigid3d>>& models);

}  // namespace adasfm
