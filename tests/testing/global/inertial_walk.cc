// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/global/inertial_walk.h"

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kStepS = 0.1;
constexpr int kNumFineSteps = 100;
const Eigen::Vector3d kLever(0.1, -0.05, 0.2);

struct Walk {
  explicit Walk(uint64_t seed) {
    Random random(seed);
    for (int axis = 0; axis < 3; ++axis) {
      for (int k = 0; k < 3; ++k) {
        amplitude(axis, k) = random.Uniform(0.1, 0.3);
        rate(axis, k) = random.Uniform(0.8, 2.0);
        phase(axis, k) = random.Uniform(0.0, 6.28);
      }
    }
  }

  // Position of the IMU, m, or a derivative of it.
  Eigen::Vector3d Position(double t, int derivative = 0) const {
    Eigen::Vector3d sum = derivative == 0   ? Eigen::Vector3d(0.7 * t, 0.0, 0.0)
                          : derivative == 1 ? Eigen::Vector3d(0.7, 0.0, 0.0)
                                            : Eigen::Vector3d(0.0, 0.0, 0.0);
    for (int axis = 0; axis < 3; ++axis) {
      for (int k = 0; k < 3; ++k) {
        const double w = rate(axis, k);
        sum[axis] += amplitude(axis, k) * std::pow(w, derivative) *
                     std::sin(w * t + phase(axis, k) + derivative * M_PI / 2);
      }
    }
    return sum;
  }

  Eigen::Quaterniond WorldFromCam(double t) const {
    return ExpSo3(Eigen::Vector3d(0.2 * std::sin(0.9 * t), 0.5 * std::sin(t),
                                  0.2 * std::cos(0.7 * t)));
  }

  Eigen::Matrix3d amplitude, rate, phase;
};

}  // namespace

WalkData SimulateWalk(const WalkOptions& options, uint64_t seed) {
  const Walk walk(seed);
  Random random(seed + 1000);
  const auto noise = [&random](double sigma) {
    return random.GaussianVector(sigma);
  };
  const auto time = [&options](double t) {
    return options.is_at_rest ? 0.0 : t;
  };
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  WalkData data;
  Eigen::Vector3d drift = Eigen::Vector3d::Zero();
  for (int i = 0; i < options.num_images; ++i) {
    const double start = i * kStepS;
    const Eigen::Quaterniond world_from_cam = walk.WorldFromCam(time(start));
    drift += noise(options.center_noise_m);
    const Eigen::Vector3d center =
        (walk.Position(time(start)) + world_from_cam * kLever + drift) /
        options.metres_per_unit;
    const Eigen::Quaterniond seen =
        world_from_cam * ExpSo3(noise(options.tilt_noise_rad));
    data.cams_from_world[i + 1] =
        Rigid3d(seen.conjugate(), -(seen.conjugate() * center));
    if (i + 1 == options.num_images) break;
    InertialMotion motion;
    motion.image_id1 = i + 1;
    motion.image_id2 = i + 2;
    motion.dt_s = kStepS;
    motion.camera_from_imu_origin = kLever;
    RelativePosePrior rotation;
    rotation.image_id1 = motion.image_id1;
    rotation.image_id2 = motion.image_id2;
    rotation.cam2_from_cam1.rotation =
        walk.WorldFromCam(time(start + kStepS)).conjugate() * world_from_cam;
    rotation.flags = kPriorRotation;
    data.rotations.push_back(rotation);
    const double dt = kStepS / kNumFineSteps;
    const Eigen::Quaterniond cam_from_world = world_from_cam.conjugate();
    for (int k = 0; k < kNumFineSteps; ++k) {
      const double t = start + (k + 0.5) * dt;
      const Eigen::Vector3d acceleration = options.is_at_rest
                                               ? Eigen::Vector3d(0.0, 0.0, 0.0)
                                               : walk.Position(t, 2);
      const Eigen::Matrix3d turned =
          (cam_from_world * walk.WorldFromCam(time(t))).toRotationMatrix();
      const Eigen::Vector3d measured =
          cam_from_world * (acceleration - gravity) +
          turned * (options.bias +
                    noise(options.accelerometer_noise / std::sqrt(dt)));
      motion.delta_position +=
          motion.delta_velocity * dt + 0.5 * dt * dt * measured;
      motion.delta_velocity += dt * measured;
      motion.position_by_bias +=
          motion.velocity_by_bias * dt - 0.5 * dt * dt * turned;
      motion.velocity_by_bias -= dt * turned;
    }
    data.motions.push_back(motion);
  }
  return data;
}

}  // namespace adasfm
