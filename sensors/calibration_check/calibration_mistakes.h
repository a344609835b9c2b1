// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace adasfm {

// One way in which a calibration may be wrong.
struct CalibrationMistake {
  enum Kind { kNone, kDegrees, kInverted, kAxes };
  Kind kind = kNone;
  // From the log's angular velocities to the camera frame's.
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  // kAxes: the signed permutation to be applied to the log.
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
};

// None (the first), angular velocities in deg/s, T_cam_imu inverted, and the
// 47 other signed permutations of the IMU's axes, those with the fewest changes
// first.
std::vector<CalibrationMistake> ListCalibrationMistakes(
    const Eigen::Matrix3d& cam_from_imu);

// "x = y, y = -x, z = z".
std::string AxesToString(const Eigen::Matrix3d& axes);

// What is wrong and what to do about it; empty for kNone.
std::string DescribeMistake(const CalibrationMistake& mistake);

}  // namespace adasfm
