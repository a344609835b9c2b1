// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/inertial_scale.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kStepS = 0.1;
constexpr int kNumFineSteps = 100;
const Eigen::Vector3d kLever(0.1, -0.05, 0.2);

// A camera that is carried about: accelerations of about 1 m/s^2 within some
// seconds, turns of half a radian.
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

  // Of the IMU, m, and its derivatives.
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

struct WalkData {
  std::vector<InertialMotion> motions;
  std::map<image_t, Rigid3d> cams_from_world;
};

struct WalkOptions {
  int num_images = 200;
  double accelerometer_noise = 0.02;  // m/s^2/sqrt(Hz)
  Eigen::Vector3d bias = Eigen::Vector3d(0.1, -0.2, 0.15);
  double center_noise_m = 0.0;  // of each step of the centres
  double tilt_noise_rad = 0.0;  // of each rotation
  double metres_per_unit = 2.0;
  bool is_at_rest = false;
};

// What an IMU of white noise integrates, by small steps.
WalkData Simulate(const WalkOptions& options, uint64_t seed) {
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

std::optional<InertialScale> Estimate(const WalkData& data) {
  return EstimateInertialScale(data.motions, data.cams_from_world);
}

// Twenty walks: errors are within three of their own sigmas but for one.
void ExpectHonest(const WalkOptions& options, double max_sigma) {
  int num_outside = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const auto scale = Estimate(Simulate(options, seed));
    ASSERT_TRUE(scale.has_value()) << "seed " << seed;
    EXPECT_LE(scale->sigma_ratio, max_sigma) << "seed " << seed;
    const double error = scale->metres_per_unit / options.metres_per_unit - 1.0;
    num_outside += std::abs(error) > 3.0 * scale->sigma_ratio;
  }
  EXPECT_LE(num_outside, 1);
}

TEST(EstimateInertialScale, FindsTheSizeOfACleanWalk) { ExpectHonest({}, 0.1); }

TEST(EstimateInertialScale, IsHonestAboutNoisyCentresAndRotations) {
  WalkOptions options;
  options.center_noise_m = 0.003;
  options.tilt_noise_rad = 0.003;
  ExpectHonest(options, 0.1);
}

TEST(EstimateInertialScale, DoesNotDependOnTheUnit) {
  WalkOptions options;
  options.center_noise_m = 0.002;
  options.metres_per_unit = 1.0;
  const auto metres = Estimate(Simulate(options, 1));
  options.metres_per_unit = 1e4;
  const auto other = Estimate(Simulate(options, 1));
  ASSERT_TRUE(metres && other);
  EXPECT_NEAR(other->metres_per_unit / metres->metres_per_unit, 1e4, 1e-2);
}

TEST(EstimateInertialScale, KnowsNothingOfAMachineAtRest) {
  WalkOptions options;
  options.is_at_rest = true;
  options.center_noise_m = 0.003;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_FALSE(Estimate(Simulate(options, seed))) << "seed " << seed;
  }
}

TEST(EstimateInertialScale, NeedsAccelerationsThatAreGravity) {
  WalkData data = Simulate({}, 1);
  for (InertialMotion& motion : data.motions) {  // in g, not m/s^2
    motion.delta_velocity /= 9.81;
    motion.delta_position /= 9.81;
  }
  EXPECT_FALSE(Estimate(data));
}

TEST(EstimateInertialScale, SpansNoHoles) {
  // Every fourth image is missing: no run has enough of them.
  WalkData data = Simulate({}, 1);
  for (image_t image_id = 4; image_id <= 200; image_id += 4) {
    data.cams_from_world.erase(image_id);
  }
  EXPECT_FALSE(Estimate(data));
}

}  // namespace
}  // namespace adasfm
