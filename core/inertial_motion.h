// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/types.h"

namespace adasfm {

// A measured translation in the axes of one camera, and its covariance (m^2).
struct MeasuredTranslation {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // m
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

// IMU measurements integrated between two images, independent of the velocity
// at the start and of gravity (Forster 2015, eqs. 33-38), in the axes of the
// first camera. With Q the rotation world_from_cam1, p and v position and
// velocity of the IMU, g the gravity of the world and b the bias of the
// accelerometer in the axes of the camera (m/s^2):
//   v2 = v1 + g dt + Q (delta_velocity + velocity_by_bias b)
//   p2 = p1 + v1 dt + g dt^2 / 2 + Q (delta_position + position_by_bias b)
// The camera is at p + Q camera_from_imu_origin. The bias of the gyroscope is
// removed; that of the accelerometer is not.
struct InertialMotion {
  image_t image_id1 = kInvalidImageId;  // the earlier one
  image_t image_id2 = kInvalidImageId;
  int drive = 0;  // as RelativePosePrior::drive
  double dt_s = 0.0;
  Eigen::Vector3d delta_velocity = Eigen::Vector3d::Zero();    // m/s
  Eigen::Vector3d delta_position = Eigen::Vector3d::Zero();    // m
  Eigen::Matrix3d velocity_by_bias = Eigen::Matrix3d::Zero();  // s
  Eigen::Matrix3d position_by_bias = Eigen::Matrix3d::Zero();  // s^2
  // Derivatives by timeshift_cam_imu: of both above (m/s^2, m/s), and of
  // by_wheels (m/s).
  Eigen::Vector3d velocity_by_time_shift = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_by_time_shift = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_by_time_shift = Eigen::Vector3d::Zero();
  // From the IMU's origin to the camera's, in the camera's axes, m.
  Eigen::Vector3d camera_from_imu_origin = Eigen::Vector3d::Zero();
  // The translation of P_12, in the axes of camera 2, from the wheels without
  // the accelerometer; replaces that of a prior where the rest of this motion
  // is used beside the prior. None without wheels, and where they slip.
  std::optional<MeasuredTranslation> by_wheels;
};

// Replaces translation and its covariance; the correlation with the rotation
// becomes 0. Rotation and flags stay.
void SetTranslation(const MeasuredTranslation& measured,
                    RelativePosePrior* prior);

// Expresses the motion in the axes of a camera that is rotated against the
// stated one.
void RotateInertialMotion(const Eigen::Quaterniond& rotated_from_cam,
                          InertialMotion* motion);

// Corrects the motion for a timeshift_cam_imu that is too small by shift_s.
void AddTimeShift(double shift_s, InertialMotion* motion);

// The length of a prior's motion, estimated from vision and accelerometer
// together.
struct InertialLength {
  image_t image_id1 = kInvalidImageId;  // the earlier one
  image_t image_id2 = kInvalidImageId;
  double length_m = 0.0;
  // 1 sigma, so large that the length does not constrain the shape: all lengths
  // of a model together determine its size to 100 %
  // (colmap_ext/coarse/measure_size.h).
  double sigma_m = 0.0;
  // 1 sigma of the unit of length, as a ratio.
  double scale_sigma = 0.0;
  // Where vision does not connect the images: the translation from the
  // accelerometer and the neighbouring velocities, a measurement of this
  // motion.
  std::optional<MeasuredTranslation> bridge = std::nullopt;
};

// Adds the lengths to the priors of the same images that have no length, with
// the flag kPriorInertialLength; without a bridge the direction stays unknown.
// Returns the largest scale_sigma of the added lengths, 0 for none.
double AddInertialLengths(const std::vector<InertialLength>& lengths,
                          std::vector<RelativePosePrior>* priors);

}  // namespace adasfm
