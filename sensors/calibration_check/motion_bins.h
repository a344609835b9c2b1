// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "core/sensor_log.h"
#include "sensors/preintegration/wheel_odometry.h"

namespace adasfm {

struct WheelFit;

// Means of both logs over bins of 0.1 s, in the wheel frame, from the later of
// the logs' first times to the earlier of their last ones.
class MotionBins {
 public:
  static constexpr double kBinS = 0.1;

  struct Bin {
    int num_imu = 0;
    int num_wheel = 0;
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();   // rad/s
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  // m/s^2
    double speed = 0.0;                               // m/s
    double yaw_rate = 0.0;                            // rad/s, the wheels'
  };

  MotionBins(const std::vector<ImuSample>& imu,
             const std::vector<WheelSpeed>& speeds,
             const Eigen::Quaterniond& wheel_from_imu);

  int size() const { return static_cast<int>(bins_.size()); }
  const Bin& operator[](int index) const { return bins_[index]; }
  Eigen::Vector3d MeanForce() const;

 private:
  std::vector<Bin> bins_;
};

// Fits the wheels to the IMU, with low weights for slipping wheels. The force
// in the wheel frame is replaced by axes * force, and the wheels' bins are
// moved later by `shift` bins.
WheelFit FitWheels(const MotionBins& bins, const Eigen::Matrix3d& axes,
                   int shift);

}  // namespace adasfm
