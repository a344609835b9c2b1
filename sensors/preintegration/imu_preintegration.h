// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "core/sensor_log.h"

namespace adasfm {

// Both biases, in the units of the samples.
struct ImuBias {
  Eigen::Vector3d gyroscope = Eigen::Vector3d::Zero();
  Eigen::Vector3d accelerometer = Eigen::Vector3d::Zero();
};

// The rotation of the body since the start of an interval.
struct RotationAtTime {
  timestamp_t timestamp_ns = 0;
  Eigen::Quaterniond start_from_body = Eigen::Quaterniond::Identity();
};

// The motion over [start, end] as an IMU with known bias measured it,
// independent of the state at the start (Forster 2015, eqs. 33-38;
// docs/reference/sensors.md). With R, v, p of the body in a world with gravity
// g:
//   R2 = R1 dR,  v2 = v1 + g dt + R1 dv,  p2 = p1 + v1 dt + g dt^2 / 2 + R1 dp.
struct ImuPreintegration {
  double dt_s = 0.0;
  ImuBias bias;
  Eigen::Quaterniond delta_rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d delta_velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d delta_position = Eigen::Vector3d::Zero();
  // Of (rotation, velocity, position): true dR = dR Exp(e), true dv = dv + e.
  // White noise only; the biases' random walk is a factor of its own.
  Eigen::Matrix<double, 9, 9> covariance = Eigen::Matrix<double, 9, 9>::Zero();
  // Derivatives by the biases; for the rotation, of Log(dR^T dR(b + db)).
  Eigen::Matrix3d rotation_by_gyroscope = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_gyroscope = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_accelerometer = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d position_by_gyroscope = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d position_by_accelerometer = Eigen::Matrix3d::Zero();

  // The motion for another bias, to first order.
  Eigen::Quaterniond CorrectedRotation(const ImuBias& new_bias) const;
  Eigen::Vector3d CorrectedVelocity(const ImuBias& new_bias) const;
  Eigen::Vector3d CorrectedPosition(const ImuBias& new_bias) const;
};

// The sample at a time inside the log, interpolated linearly.
ImuSample InterpolateImu(const std::vector<ImuSample>& samples,
                         timestamp_t timestamp_ns);

// Integrates by the midpoint rule, interpolating at both ends. Throws
// std::invalid_argument when the log does not cover [start, end]. profile (may
// be null) receives the rotation at the start and at the end of every step.
ImuPreintegration PreintegrateImu(
    const std::vector<ImuSample>& samples, timestamp_t start_ns,
    timestamp_t end_ns, const ImuBias& bias, const ImuNoise& noise,
    std::vector<RotationAtTime>* profile = nullptr);

}  // namespace adasfm
