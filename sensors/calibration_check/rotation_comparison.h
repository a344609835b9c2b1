// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "core/sensor_log.h"
#include "core/types.h"

namespace adasfm {

// Integrals of the angular velocity, as a vector and as a rotation, at any
// time. Keeps a reference to the samples.
class RateIntegral {
 public:
  explicit RateIntegral(const std::vector<ImuSample>& imu);

  bool Covers(timestamp_t time_ns) const;
  // Of rates that are linear between samples; undefined outside of the log.
  Eigen::Vector3d At(timestamp_t time_ns) const;
  // The rotation vector of start_from_end, bodies at these times. It differs
  // from the integral above where the rotation axis changes.
  Eigen::Vector3d Turn(timestamp_t start_ns, timestamp_t end_ns) const;
  // Mean angular velocity over 20 ms about a time, as far as the log reaches.
  Eigen::Vector3d MeanRate(timestamp_t time_ns) const;

 private:
  // The last sample up to a time, and the integral from there on.
  size_t Sample(timestamp_t time_ns) const;
  Eigen::Vector3d Rest(size_t sample, timestamp_t time_ns) const;
  Eigen::Quaterniond FirstFromBody(timestamp_t time_ns) const;

  const std::vector<ImuSample>& imu_;
  std::vector<Eigen::Vector3d> integral_;
  std::vector<Eigen::Quaterniond> first_from_body_;
};

// Rotation vectors of vision and gyroscope over the same intervals.
struct RotationComparison {
  std::vector<Eigen::Vector3d> visual;  // in the camera frame
  std::vector<Eigen::Vector3d> gyro;    // in the IMU frame
  std::vector<double> start_s;          // on the IMU's clock
  std::vector<double> dt_s;

  void Append(const RotationComparison& other);
};

struct RotationFit {
  double cost = std::numeric_limits<double>::infinity();  // rad/s, mean
  Eigen::Vector3d rate_offset = Eigen::Vector3d::Zero();  // rad/s, camera
};

// Mean distance between the mean rates of the visual rotations and of the
// mapped gyroscope, minus a constant (the bias). Rates, because model errors (a
// small rotation error of T_cam_imu) grow with the interval; medians and plain
// distances, so that a few wrong two-view geometries do not matter.
RotationFit ComputeRotationFit(const RotationComparison& data,
                               const Eigen::Matrix3d& map);

// The distances whose mean is the fit's cost, one per interval.
std::vector<double> ComputeRateDistances(const RotationComparison& data,
                                         const Eigen::Matrix3d& map,
                                         const Eigen::Vector3d& rate_offset);

// Log likelihood ratio of the better over the worse explanation, from the
// distances of both. Errors follow Student's distribution with three degrees of
// freedom (two-view geometries have long tails), scaled by the worse
// explanation's median, which favours the worse one. num_repeats is how often
// the intervals cover the same time: that many count as one.
double ComputeEvidence(const std::vector<double>& worse,
                       const std::vector<double>& better, double num_repeats);

// Minimum evidence for another explanation. The best of some 10,000 wrong ones
// (50 at 200 shifts) is by chance e^9 times likelier than the right one; the
// minimum is about twice that.
inline constexpr double kMinEvidence = 20.0;

// Correlation of all axes together, about the means.
double ComputeRotationCorrelation(const RotationComparison& data,
                                  const Eigen::Matrix3d& map);

}  // namespace adasfm
