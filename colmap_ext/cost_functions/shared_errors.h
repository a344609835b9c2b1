// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <map>
#include <string>

#include "core/rigid3d.h"

namespace adasfm {

// What is believed, before an adjustment, of the errors that all motions of a
// sequence share (docs/reference/math.md, Shared errors of the odometry). The
// adjustment estimates them together with the poses; 0 holds an error at zero.
struct SharedErrorOptions {
  bool enabled = true;
  // 1 sigma, per axis, of what the import left of the gyroscope's bias, and of
  // its random walk.
  double gyroscope_bias_sigma_rad_s = 1e-3;
  double gyroscope_random_walk_rad_s_sqrt_s = 2e-5;
  // One bias for each of these spans.
  double gyroscope_window_s = 20.0;
  // Of the rotation of T_cam_imu, per axis.
  double extrinsic_rotation_sigma_rad = 5e-3;
  // Of the direction of driving in the camera, per axis: T_imu_wheel, and again
  // T_cam_imu.
  double driving_direction_sigma_rad = 0.035;
  // Within the drive the direction drifts with the tilt and the velocity that
  // the smoother found: a Gauss-Markov process of this correlation time, with
  // one value for each window and the sigma that the motions state (the
  // median). docs/reference/math.md has what was measured.
  double direction_drift_time_s = 3.0;
  double direction_window_s = 2.0;
  // The smoother's velocity errs along the motion, too, as wheels do that slip
  // for seconds: 1 sigma of the same process in lengths, as a ratio. The import
  // states it; 0 leaves lengths independent.
  double length_drift_ratio = 0.0;

  bool IsValid(std::string* error) const;
};

// What one motion has of the errors that vary within a sequence.
struct SharedErrorWindows {
  // Counted through the sequence.
  int gyroscope = 0;
  int direction = 0;
  // By how much larger than across the motion the drift is along it: sigma of
  // lengths, as a ratio, over sigma of directions.
  double length_per_direction = 0.0;
};

// The errors of a sequence. For a motion with the stated cam2_from_cam1 = (R^,
// t^) over dt, H = Exp(Log(R^) / 2), to first order
//   R = Exp(dt H b + (I - R^) e) R^,  t = (1 + k u . H d) Exp(H (m + d)) t^
// with b: gyroscope_bias of its window, e: extrinsic_rotation, m:
// driving_direction, d: direction_drift of its window, all in the frame of the
// camera, u = t^ / |t^| and k = length_per_direction. A turn about u moves
// nothing, so that component of d is free to be the drift of the length. A
// common scale of all lengths is none of them: it leaves the shape of the model
// as it is, and nothing but the lengths observes it.
struct SharedErrors {
  // By window, rad/s; zero where there is none.
  std::map<int, Eigen::Vector3d> gyroscope_bias;
  Eigen::Vector3d extrinsic_rotation = Eigen::Vector3d::Zero();  // rad
  Eigen::Vector3d driving_direction = Eigen::Vector3d::Zero();   // rad
  // By window, rad across the motion and 1 / length_per_direction along it.
  std::map<int, Eigen::Vector3d> direction_drift;

  Rigid3d Correct(const Rigid3d& cam2_from_cam1, double dt_s,
                  const SharedErrorWindows& windows) const;
};

// H: from the frame in the middle of a motion to the later camera.
Eigen::Matrix3d CameraFromMiddle(const Eigen::Quaterniond& cam2_from_cam1);

}  // namespace adasfm
