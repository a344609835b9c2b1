// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/inertial_motion.h"
#include "core/random.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

struct TimedPose {
  image_t image_id = kInvalidImageId;
  timestamp_t timestamp_ns = 0;
  Rigid3d cam_from_world;
};

// Integrals of an IMU beside the camera between the images of the drive, with
// white noise (m/s^2 sqrt(s)) and this bias. Velocities are differences of the
// positions: one of many motions that pass the images.
struct InertialDriveOptions {
  double noise = 0.0;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  // m/s^2, camera's axes
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();
  uint64_t seed = 1;
};

inline std::vector<InertialMotion> IntegrateDrive(
    std::vector<TimedPose> images, const InertialDriveOptions& options) {
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  Random random(options.seed);
  std::sort(images.begin(), images.end(),
            [](const TimedPose& a, const TimedPose& b) {
              return a.timestamp_ns < b.timestamp_ns;
            });
  std::vector<double> seconds;
  std::vector<Eigen::Matrix3d> cam_from_world;
  std::vector<Eigen::Vector3d> position, velocity;
  for (const TimedPose& image : images) {
    seconds.push_back(
        SecondsFromNs(image.timestamp_ns - images[0].timestamp_ns));
    cam_from_world.push_back(image.cam_from_world.rotation.toRotationMatrix());
    position.push_back(image.cam_from_world.TargetOriginInSource() -
                       cam_from_world.back().transpose() * options.lever);
  }
  for (size_t i = 0; i < images.size(); ++i) {
    const size_t first = i > 0 ? i - 1 : 0;
    const size_t last = std::min(i + 1, images.size() - 1);
    velocity.push_back((position[last] - position[first]) /
                       (seconds[last] - seconds[first]));
  }
  std::vector<InertialMotion> motions;
  for (size_t i = 0; i + 1 < images.size(); ++i) {
    InertialMotion motion;
    motion.image_id1 = images[i].image_id;
    motion.image_id2 = images[i + 1].image_id;
    const double dt = motion.dt_s = seconds[i + 1] - seconds[i];
    motion.camera_from_imu_origin = options.lever;
    motion.velocity_by_bias = -dt * Eigen::Matrix3d::Identity();
    motion.position_by_bias = -0.5 * dt * dt * Eigen::Matrix3d::Identity();
    // White noise: its mean over the interval, and the deviation of its
    // integral from that of the mean.
    const Eigen::Vector3d of_velocity =
        random.GaussianVector(options.noise * std::sqrt(dt));
    const Eigen::Vector3d of_position =
        random.GaussianVector(options.noise * std::sqrt(dt * dt * dt / 12.0));
    motion.delta_velocity =
        cam_from_world[i] * (velocity[i + 1] - velocity[i] - gravity * dt) -
        motion.velocity_by_bias * options.bias + of_velocity;
    motion.delta_position =
        cam_from_world[i] * (position[i + 1] - position[i] - velocity[i] * dt -
                             0.5 * dt * dt * gravity) -
        motion.position_by_bias * options.bias + 0.5 * dt * of_velocity +
        of_position;
    motions.push_back(motion);
  }
  return motions;
}

}  // namespace adasfm
