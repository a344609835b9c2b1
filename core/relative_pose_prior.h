// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "core/rigid3d.h"
#include "core/so3.h"
#include "core/types.h"

namespace adasfm {

// Which components of the motion were observed. The value of a component that
// was not observed must not be used.
enum PriorFlags : uint32_t {
  kPriorRotation = 1u << 0,
  kPriorDirection = 1u << 1,  // of the translation
  kPriorLength = 1u << 2,     // of the translation, in metres
  kPriorWheelSlip = 1u << 3,  // wheels contradicted the IMU: weights are low
  // The length is in metres of the accelerometer. Without kPriorDirection
  // vision provided the length: it is no measurement of this motion alone.
  kPriorInertialLength = 1u << 4,
};

// The motion between two images as the sensors measured it. image_id1 is the
// earlier one.
struct RelativePosePrior {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  // The time between both, without hours parked: over it, errors of the
  // sensors' rates add up.
  timestamp_t dt_ns = 0;
  // P_12, translation in metres.
  Rigid3d cam2_from_cam1;
  // Of (rotation, translation), both in the frame of camera 2: the true motion
  // is R_true = Exp(dtheta) R, t_true = t + dt, (dtheta, dt) ~ N(0,
  // covariance). Units rad^2, rad m, m^2. The diagonal is infinite where
  // nothing is known.
  Eigen::Matrix<double, 6, 6> covariance =
      Eigen::Matrix<double, 6, 6>::Identity();
  uint32_t flags = 0;
  // Where timeshift_cam_imu is wrong by c, R_true = Exp(c
  // rotation_by_time_shift) R and t_true = t + c translation_by_time_shift to
  // first order (docs/reference/math.md). rad/s and m/s, in the frame of camera
  // 2; zero where no IMU measured the motion.
  Eigen::Vector3d rotation_by_time_shift = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_by_time_shift = Eigen::Vector3d::Zero();
  // Number of the drive, from 0. The errors of calibration and biases are those
  // of one drive.
  int drive = 0;

  bool HasRotation() const { return flags & kPriorRotation; }
  bool HasDirection() const { return flags & kPriorDirection; }
  bool HasLength() const { return flags & kPriorLength; }
  bool HasTranslation() const { return HasDirection() && HasLength(); }
  bool HasMotion() const { return HasRotation() && HasTranslation(); }
  // Whether the length is a measurement of this motion alone.
  bool HasOwnLength() const {
    return HasTranslation() || (HasLength() && !(flags & kPriorInertialLength));
  }
};

// Transforms the prior to a rotated camera frame.
inline void RotatePrior(const Eigen::Quaterniond& rotated_from_cam,
                        RelativePosePrior* prior) {
  Rigid3d& motion = prior->cam2_from_cam1;
  motion.rotation =
      (rotated_from_cam * motion.rotation * rotated_from_cam.conjugate())
          .normalized();
  motion.translation = rotated_from_cam * motion.translation;
  prior->rotation_by_time_shift =
      rotated_from_cam * prior->rotation_by_time_shift;
  prior->translation_by_time_shift =
      rotated_from_cam * prior->translation_by_time_shift;
  const Eigen::Matrix3d matrix = rotated_from_cam.toRotationMatrix();
  for (int row = 0; row < 6; row += 3) {
    for (int col = 0; col < 6; col += 3) {
      auto block = prior->covariance.block<3, 3>(row, col);
      // A block that is not observed is not finite in any direction.
      if (!block.allFinite()) continue;
      block = (matrix * block * matrix.transpose()).eval();
    }
  }
}

// Corrects the prior for a timeshift_cam_imu that is too small by shift_s.
inline void AddTimeShift(double shift_s, RelativePosePrior* prior) {
  Rigid3d& motion = prior->cam2_from_cam1;
  motion.rotation =
      (ExpSo3(shift_s * prior->rotation_by_time_shift) * motion.rotation)
          .normalized();
  motion.translation += shift_s * prior->translation_by_time_shift;
}

// 1 sigma of a gyroscope's scale, relative, per axis: of data sheets of small
// ones.
inline constexpr double kGyroscopeScaleSigma = 0.01;

// Corrects the prior for the scale errors of the gyroscope: the shares by which
// the rates about the axes of the camera have to grow.
inline void CorrectGyroscopeScales(const Eigen::Vector3d& scales,
                                   RelativePosePrior* prior) {
  Rigid3d& motion = prior->cam2_from_cam1;
  const Eigen::Vector3d error = scales.cwiseProduct(LogSo3(motion.rotation));
  motion.rotation = (ExpSo3(error) * motion.rotation).normalized();
  // The direction is known in the middle of the motion.
  motion.translation = ExpSo3(0.5 * error) * motion.translation;
}

}  // namespace adasfm
