// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/random.h"
#include "core/rigid3d.h"
#include "synthetic/path.h"
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

// A smooth drive along a path, known in closed form. The arc length s(t)
// follows a speed profile that starts at rest, slows down in bends and has
// stops, at some of which the machine turns on the spot. The wheel frame weaves
// about the path, and the body rolls, pitches and heaves with the distance
// driven.
class Drive {
 public:
  Drive(const SyntheticWorldOptions& options, const Path& path,
        const Rigid3d& imu_from_wheel);

  // At rest from begin to end, except for a turn on the spot by turn_rad.
  struct Stop {
    double begin_s, end_s, turn_rad;
  };

  DriveState StateAt(double time_s) const;
  double ArcLengthAt(double time_s) const;
  // The time at which the car reaches arc_length_m; the inverse of ArcLengthAt.
  double TimeAt(double arc_length_m) const;
  double FirstImageTime() const;
  // Even under way: the last is that at which a drive without stops has covered
  // the spacings of all images.
  const std::vector<double>& ImageTimes() const { return image_times_s_; }
  double ImagePeriod() const { return image_period_s_; }
  const std::vector<Stop>& stops() const { return stops_; }

 private:
  struct Wave {
    double amplitude, wave_number, phase;
  };
  void DrawWaves(const SyntheticWorldOptions& options);
  void SetImageTimes(const SyntheticWorldOptions& options, int num_images);
  void AddStops(const SyntheticWorldOptions& options);
  void AddImagesAtRest(const SyntheticWorldOptions& options);
  int LastBendIndex(double s) const;
  double NominalTime(double s) const;
  double ArcLengthAtNominalTime(double tau) const;
  double NominalTimeAt(double time_s) const;

  template <typename T>
  T SpeedFactor(const T& time_s) const;
  template <typename T>
  T Slowness(const T& s) const;
  template <typename T>
  T TurnOnTheSpot(const T& time_s) const;

  Rigid3d imu_from_wheel_;
  double cruise_speed_;
  double standstill_s_;
  Path path_;
  // Slope of the road: height per distance driven.
  double slope_;
  double image_period_s_ = 0.0;
  std::vector<double> image_times_s_;
  std::vector<Stop> stops_;
  std::vector<Wave> weave_, roll_, pitch_, heave_;
};

}  // namespace adasfm
