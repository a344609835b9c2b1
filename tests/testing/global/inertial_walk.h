// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

struct WalkData {
  std::vector<InertialMotion> motions;
  std::vector<RelativePosePrior> rotations;  // of the gyroscope, without error
  std::map<image_t, Rigid3d> cams_from_world;
};

struct WalkOptions {
  int num_images = 200;
  double accelerometer_noise = 0.02;  // m/s^2/sqrt(Hz)
  Eigen::Vector3d bias = Eigen::Vector3d(0.1, -0.2, 0.15);
  double center_noise_m = 0.0;  // of each step of the centres
  double tilt_noise_rad = 0.0;  // of each rotation
  double metres_per_unit = 2.0;
  bool is_at_rest = false;
};

// A hand-carried camera with image ids 1, 2, ... every 0.1 s: accelerations of
// about 1 m/s^2 within some seconds, rotations of half a radian. The motions
// are those of an IMU with white noise, integrated by small steps.
WalkData SimulateWalk(const WalkOptions& options, uint64_t seed);

}  // namespace adasfm
