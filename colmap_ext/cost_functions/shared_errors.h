// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <map>
#include <string>

#include "core/rigid3d.h"

namespace adasfm {

// Priors of mean zero on the errors that all motions of a drive share
// (docs/reference/math.md, Shared errors of the odometry). The adjustment
// estimates the errors together with the poses; a sigma of 0 holds one at zero.
struct SharedErrorOptions {
  bool enabled = true;
  // 1 sigma, per axis, of the random walk of the gyroscope bias that the import
  // left: of small gyroscopes that warm up, five times what they have at rest.
  double gyroscope_random_walk_rad_s_sqrt_s = 1e-4;
  // Length of the windows with one bias each.
  double gyroscope_window_s = 20.0;
  // 1 sigma of the rotation of T_cam_imu, per axis.
  double extrinsic_rotation_sigma_rad = 5e-3;
  // 1 sigma of the direction of driving in the camera, per axis. It covers the
  // errors of T_imu_wheel and, again, of T_cam_imu.
  double driving_direction_sigma_rad = 0.035;
  // Within the drive the direction drifts with errors of the smoother's tilt
  // and velocity: a Gauss-Markov process of this correlation time, with one
  // value for each window (kDirectionWindowS) and the median sigma that the
  // motions state. 0: no drift.
  // docs/reference/math.md has measurements.
  double direction_drift_time_s = 3.0;
  // Relative 1 sigma of the same process in lengths: the smoother's velocity
  // also errs along the motion, as where wheels slip for seconds. The import
  // states it; 0 leaves lengths independent.
  double length_drift_ratio = 0.0;

  bool IsValid(std::string* error) const;
};

// 1 sigma of the gyroscope's bias that the import left at the beginning of a
// drive, per axis.
inline constexpr double kGyroscopeBiasSigmaRadS = 1e-3;
// Length of the windows with one direction drift each.
inline constexpr double kDirectionWindowS = 2.0;

// Selects the values of the errors that apply to a motion, and how they do.
struct SharedErrorWindows {
  int drive = 0;  // RelativePosePrior::drive
  // Numbers of the windows of varying errors, counted through all drives.
  int gyroscope = 0;
  int direction = 0;
  // Drift along the motion over drift across it: relative sigma of lengths over
  // sigma of directions.
  double length_per_direction = 0.0;
  // Whether the lengths of the drive have a scale of their own.
  bool has_length_scale = false;
  // As in RelativePosePrior.
  Eigen::Vector3d rotation_by_time_shift = Eigen::Vector3d::Zero();

  bool DependOnTimeShift() const { return !rotation_by_time_shift.isZero(0.0); }
};

// The errors of all drives. For a motion with the stated cam2_from_cam1 = (R^,
// t^) over dt, H = Exp(Log(R^) / 2), to first order
//   R = Exp(dt H b + (I - R^) e + g o Log(R^) + c q) R^
//   t = (1 + s + k u . H d) Exp(H (m + d)) t^
// with b: gyroscope_bias of its window, e: extrinsic_rotation and m:
// driving_direction of its drive, d: direction_drift of its window, all in the
// frame of the camera, u = t^ / |t^| and k = length_per_direction. g:
// gyroscope_scale of the drive, about each axis of the camera (o: by element).
// c: time_shift of the drive, q: rotation_by_time_shift of the motion. A
// rotation about u does not change t^, so that component of d serves as the
// drift of the length. s: length_scale of the drive, where several drives have
// lengths. A common scale of all lengths is not included: it does not change
// the shape of the model, and only the lengths observe it.
struct SharedErrors {
  // Errors that a map does not have are zero.
  std::map<int, Eigen::Vector3d> gyroscope_bias;      // by window, rad/s
  std::map<int, Eigen::Vector3d> extrinsic_rotation;  // by drive, rad
  std::map<int, Eigen::Vector3d> gyroscope_scale;     // by drive, relative
  std::map<int, Eigen::Vector3d> driving_direction;   // by drive, rad
  // By window: rad across the motion; along it relative length error over
  // length_per_direction.
  std::map<int, Eigen::Vector3d> direction_drift;
  std::map<int, double> length_scale;  // by drive, relative
  std::map<int, double> time_shift;    // by drive, s, of timeshift_cam_imu

  Rigid3d Correct(const Rigid3d& cam2_from_cam1, double dt_s,
                  const SharedErrorWindows& windows) const;
};

// H: rotation from the frame in the middle of a motion to the later camera.
Eigen::Matrix3d CameraFromMiddle(const Eigen::Quaterniond& cam2_from_cam1);

}  // namespace adasfm
