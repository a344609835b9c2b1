// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/random.h"
#include "core/rigid3d.h"
#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// The state of the car at one instant; velocities of the IMU's origin.
struct DriveState {
  Rigid3d world_from_imu;
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_in_imu = Eigen::Vector3d::Zero();
  // Of the wheel frame: forward speed and yaw rate.
  double wheel_speed = 0.0;
  double wheel_yaw_rate = 0.0;
};

// A smooth drive along a route through the street grid, known in closed form:
// arc length s(t) from a speed profile that starts at rest and slows down in
// bends, the wheel frame's path with a weave about the street's axis, and a
// body that rolls, pitches and heaves with the distance driven.
class Drive {
 public:
  Drive(const SyntheticWorldOptions& options, const Route& route,
        const Rigid3d& imu_from_wheel);

  DriveState StateAt(double time_s) const;
  double ArcLengthAt(double time_s) const;
  // The time at which the car has driven so far; the inverse of ArcLengthAt.
  double TimeAt(double arc_length_m) const;
  double FirstImageTime() const;

 private:
  struct Wave {
    double amplitude, wave_number, phase;
  };
  // A piece of the route's axis: straight, or a bend by turn * 90 deg.
  struct Segment {
    double begin, length;
    Eigen::Vector2d start;
    double heading;
    int turn;
  };

  void BuildSegments(const Route& route);
  void DrawWaves(const SyntheticWorldOptions& options);
  const Segment& SegmentAt(double s) const;
  Eigen::Vector2d AxisPosition(double s) const;
  double NominalTime(double s) const;
  double ArcLengthAtNominalTime(double tau) const;
  double NominalTimeAt(double time_s) const;

  template <typename T>
  T SpeedFactor(const T& time_s) const;
  template <typename T>
  T Slowness(const T& s) const;
  template <typename T>
  T Heading(const T& s) const;
  template <typename T>
  T Curvature(const T& s) const;

  Rigid3d imu_from_wheel_;
  double cruise_speed_;
  double standstill_s_;
  std::vector<Segment> segments_;
  // Where bends begin, ascending.
  std::vector<double> bends_;
  std::vector<Wave> weave_, roll_, pitch_, heave_;
};

}  // namespace adasfm
