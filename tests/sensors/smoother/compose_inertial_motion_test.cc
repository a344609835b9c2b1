// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/compose_inertial_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);
constexpr double kStep = 0.005;  // s, of the IMU
constexpr double kPositionAmplitude = 1.0;
constexpr double kTurnAmplitude = 0.4;
constexpr double kFrequency = 2.5;  // rad/s; the bounds below hold up to it

// A body whose position and rotation vector swing, in closed form.
class Swing {
 public:
  explicit Swing(Random* random) {
    for (int axis = 0; axis < 3; ++axis) {
      frequency_[axis] = random->Uniform(1.0, kFrequency);
      phase_[axis] = random->Uniform(0.0, 2.0 * M_PI);
    }
  }

  Rigid3d WorldFromImu(double t) const {
    return Rigid3d(ExpSo3(kTurnAmplitude * Sine(t)),
                   kPositionAmplitude * Sine(t));
  }
  Eigen::Vector3d Velocity(double t) const {
    return kPositionAmplitude * frequency_.cwiseProduct(Cosine(t));
  }
  ImuSample SampleAt(double t) const {
    const Eigen::Vector3d turn = kTurnAmplitude * Sine(t);
    const Eigen::Vector3d acceleration =
        -kPositionAmplitude * frequency_.cwiseAbs2().cwiseProduct(Sine(t));
    ImuSample sample;
    sample.timestamp_ns = std::llround(1e9 * t);
    sample.angular_velocity =
        RightJacobianSo3(turn) *
        (kTurnAmplitude * frequency_.cwiseProduct(Cosine(t)));
    sample.specific_force =
        ExpSo3(turn).conjugate() * (acceleration - kGravity);
    return sample;
  }

 private:
  Eigen::Vector3d Sine(double t) const {
    return (frequency_ * t + phase_).array().sin();
  }
  Eigen::Vector3d Cosine(double t) const {
    return (frequency_ * t + phase_).array().cos();
  }

  Eigen::Vector3d frequency_, phase_;
};

// Ten links whose ends lie between samples; the images are at the ends of
// links kFirst and kLast - 1.
constexpr size_t kFirst = 2, kLast = 7;
constexpr timestamp_t kLinkNs = 173'456'789;

struct Chain {
  explicit Chain(uint64_t seed) : random(seed), swing(&random) {
    bias.gyroscope = random.GaussianVector(0.003);
    bias.accelerometer = 0.3 * random.UnitVector();
    std::vector<ImuSample> samples;
    for (int i = 0; i * kStep < 2.0; ++i) {
      samples.push_back(swing.SampleAt(i * kStep));
      samples.back().angular_velocity += bias.gyroscope;
      samples.back().specific_force += bias.accelerometer;
    }
    // Links are integrated about another bias than the one estimated later.
    ImuBias assumed;
    assumed.accelerometer = random.GaussianVector(0.1);
    OdometryState state;
    state.bias.gyroscope = bias.gyroscope;
    state.bias.accelerometer = random.GaussianVector(0.1);
    for (int k = 0; k < 10; ++k) {
      OdometryLink link;
      link.has_imu = true;
      link.imu = PreintegrateImu(samples, k * kLinkNs, (k + 1) * kLinkNs,
                                 assumed, ImuNoise());
      link.dt_s = link.imu.dt_s;
      problem.links.push_back(link);
    }
    fused.states.assign(11, state);
    cam_from_imu =
        Rigid3d(ExpSo3(random.GaussianVector(1.0)), random.GaussianVector(0.5));
  }

  Random random;
  Swing swing;
  ImuBias bias;
  OdometryFusionProblem problem;
  OdometryFusionResult fused;
  Rigid3d cam_from_imu;
};

TEST(ComposeInertialMotion, HoldsTheTrueMotionWithTheBias) {
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    SCOPED_TRACE(seed);
    const Chain chain(seed);
    const std::optional<InertialMotion> motion = ComposeInertialMotion(
        chain.problem, chain.fused, kFirst, kLast, chain.cam_from_imu);
    ASSERT_TRUE(motion.has_value());
    const double t1 = 1e-9 * kFirst * kLinkNs, t2 = 1e-9 * kLast * kLinkNs;
    const double dt = t2 - t1;
    EXPECT_NEAR(motion->dt_s, dt, 1e-9);
    const Rigid3d pose1 = chain.swing.WorldFromImu(t1);
    const Rigid3d pose2 = chain.swing.WorldFromImu(t2);
    const Eigen::Quaterniond world_from_cam1 =
        pose1.rotation * chain.cam_from_imu.rotation.conjugate();
    const Eigen::Vector3d bias =
        chain.cam_from_imu.rotation * chain.bias.accelerometer;

    // The trapezoidal rule errs by h^2/12 of the second derivative: of the
    // force, which rotates with the body, and of the rate, which tilts the
    // force. Three axes oscillate. The first-order correction for the
    // gyroscope's bias errs by the square of its rotation over a link.
    const double force = kGravity.norm() + std::sqrt(3.0) * kPositionAmplitude *
                                               kFrequency * kFrequency;
    const double rate = std::sqrt(3.0) * kTurnAmplitude * kFrequency;
    const double force_curvature =
        force * std::pow(rate + kFrequency, 2);  // m/s^4
    const double rate_curvature = rate * std::pow(rate + kFrequency, 2);
    const double bias_turn = chain.bias.gyroscope.norm() * 1e-9 * kLinkNs;
    const double tilt = kStep * kStep / 12.0 * rate_curvature * dt +
                        (kLast - kFirst) * bias_turn * bias_turn;
    const double acceleration_error =
        kStep * kStep / 12.0 * force_curvature + force * tilt;

    const Eigen::Vector3d v1 = chain.swing.Velocity(t1);
    const Eigen::Vector3d v2 = chain.swing.Velocity(t2);
    const Eigen::Vector3d velocity_error =
        v1 + kGravity * dt + world_from_cam1 * motion->delta_velocity - v2;
    const Eigen::Vector3d position_error =
        pose1.translation + v1 * dt + 0.5 * dt * dt * kGravity +
        world_from_cam1 * motion->delta_position - pose2.translation;
    EXPECT_LT(
        (velocity_error + world_from_cam1 * (motion->velocity_by_bias * bias))
            .norm(),
        acceleration_error * dt);
    EXPECT_LT(
        (position_error + world_from_cam1 * (motion->position_by_bias * bias))
            .norm(),
        0.5 * acceleration_error * dt * dt);
    // Without the bias terms the bounds are exceeded. The body rotates, so that
    // the bias does not add up completely.
    EXPECT_GT(velocity_error.norm(), 0.5 * bias.norm() * dt);
    EXPECT_GT(position_error.norm(), 0.25 * bias.norm() * dt * dt);

    const Eigen::Vector3d camera =
        pose1 * chain.cam_from_imu.Inverse().translation;
    EXPECT_LT((pose1.translation +
               world_from_cam1 * motion->camera_from_imu_origin - camera)
                  .norm(),
              1e-12);
  }
}

TEST(ComposeInertialMotion, NeedsTheImuThroughout) {
  Chain chain(1);
  const auto has_motion = [&chain]() {
    return ComposeInertialMotion(chain.problem, chain.fused, kFirst, kLast,
                                 chain.cam_from_imu)
        .has_value();
  };
  chain.problem.links[kFirst - 1].has_imu = false;
  chain.problem.links[kLast].has_imu = false;
  EXPECT_TRUE(has_motion());
  chain.problem.links[kLast - 1].has_imu = false;
  EXPECT_FALSE(has_motion());
}

}  // namespace
}  // namespace adasfm
