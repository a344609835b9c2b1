// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/preintegration/imu_preintegration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

// A motion in closed form: the body rotates at a constant rate while its
// velocity in the world oscillates.
struct Motion {
  Eigen::Vector3d rate{0.3, -0.5, 0.8};
  Eigen::Vector3d amplitude{1.0, 2.0, 0.5};
  Eigen::Vector3d frequency{1.3, 0.7, 2.1};

  Eigen::Quaterniond Rotation(double t) const { return ExpSo3(rate * t); }
  Eigen::Vector3d Position(double t) const {
    return amplitude.cwiseProduct((frequency * t).array().sin().matrix());
  }
  Eigen::Vector3d Velocity(double t) const {
    return amplitude.cwiseProduct(frequency).cwiseProduct(
        (frequency * t).array().cos().matrix());
  }
  Eigen::Vector3d Acceleration(double t) const {
    return -Position(t).cwiseProduct(frequency.cwiseAbs2());
  }
};

std::vector<ImuSample> Sample(const Motion& motion, double rate_hz,
                              double duration_s) {
  std::vector<ImuSample> samples;
  for (int i = 0; i <= std::lround(rate_hz * duration_s); ++i) {
    const double t = i / rate_hz;
    ImuSample sample;
    sample.timestamp_ns = std::llround(1e9 * t);
    sample.angular_velocity = motion.rate;
    sample.specific_force =
        motion.Rotation(t).conjugate() * (motion.Acceleration(t) - kGravity);
    samples.push_back(sample);
  }
  return samples;
}

TEST(PreintegrateImu, FollowsAnalyticMotion) {
  const Motion motion;
  const std::vector<ImuSample> samples = Sample(motion, 1000.0, 1.0);
  // Both ends lie between samples, so both are interpolated.
  const double t1 = 0.12345, t2 = 0.87654, dt = t2 - t1;
  const ImuPreintegration imu =
      PreintegrateImu(samples, 123'450'000, 876'540'000, ImuBias(), ImuNoise());
  const Eigen::Quaterniond r1 = motion.Rotation(t1);
  EXPECT_NEAR(imu.dt_s, dt, 1e-12);
  EXPECT_LT(AngleBetweenRad(r1 * imu.delta_rotation, motion.Rotation(t2)),
            1e-9);
  const Eigen::Vector3d v2 =
      motion.Velocity(t1) + kGravity * dt + r1 * imu.delta_velocity;
  EXPECT_LT((v2 - motion.Velocity(t2)).norm(), 1e-5);
  const Eigen::Vector3d p2 = motion.Position(t1) + motion.Velocity(t1) * dt +
                             0.5 * dt * dt * kGravity + r1 * imu.delta_position;
  EXPECT_LT((p2 - motion.Position(t2)).norm(), 1e-5);
}

TEST(PreintegrateImu, ErrorFallsWithTheSquareOfTheStep) {
  const Motion motion;
  double errors[2];
  for (int i = 0; i < 2; ++i) {
    const ImuPreintegration imu =
        PreintegrateImu(Sample(motion, i == 0 ? 100.0 : 200.0, 1.0), 0,
                        1'000'000'000, ImuBias(), ImuNoise());
    const Eigen::Vector3d v2 =
        motion.Velocity(0.0) + kGravity + imu.delta_velocity;
    errors[i] = (v2 - motion.Velocity(1.0)).norm();
  }
  EXPECT_NEAR(errors[0] / errors[1], 4.0, 0.5);
}

TEST(PreintegrateImu, BiasJacobiansMatchNumericDerivatives) {
  const std::vector<ImuSample> samples = Sample(Motion(), 200.0, 1.0);
  const timestamp_t end = 713'000'000;
  const ImuBias bias{{0.01, -0.02, 0.03}, {0.1, 0.2, -0.3}};
  const auto integrate = [&](const ImuBias& b) {
    return PreintegrateImu(samples, 2'000'000, end, b, ImuNoise());
  };
  const ImuPreintegration imu = integrate(bias);
  constexpr double kStep = 1e-5;
  for (int axis = 0; axis < 3; ++axis) {
    ImuBias plus = bias, minus = bias;
    plus.gyroscope[axis] += kStep;
    minus.gyroscope[axis] -= kStep;
    ImuPreintegration a = integrate(plus), b = integrate(minus);
    const Eigen::Vector3d rotation =
        (LogSo3(imu.delta_rotation.conjugate() * a.delta_rotation) -
         LogSo3(imu.delta_rotation.conjugate() * b.delta_rotation)) /
        (2.0 * kStep);
    EXPECT_LT((rotation - imu.rotation_by_gyroscope.col(axis)).norm(), 1e-6);
    EXPECT_LT(((a.delta_velocity - b.delta_velocity) / (2.0 * kStep) -
               imu.velocity_by_gyroscope.col(axis))
                  .norm(),
              1e-4);
    EXPECT_LT(((a.delta_position - b.delta_position) / (2.0 * kStep) -
               imu.position_by_gyroscope.col(axis))
                  .norm(),
              1e-4);
    plus = minus = bias;
    plus.accelerometer[axis] += kStep;
    minus.accelerometer[axis] -= kStep;
    a = integrate(plus);
    b = integrate(minus);
    EXPECT_LT(((a.delta_velocity - b.delta_velocity) / (2.0 * kStep) -
               imu.velocity_by_accelerometer.col(axis))
                  .norm(),
              1e-8);
    EXPECT_LT(((a.delta_position - b.delta_position) / (2.0 * kStep) -
               imu.position_by_accelerometer.col(axis))
                  .norm(),
              1e-8);
  }
}

TEST(PreintegrateImu, BiasCorrectionIsFirstOrder) {
  const std::vector<ImuSample> samples = Sample(Motion(), 200.0, 0.5);
  const ImuBias bias{{0.004, -0.003, 0.005}, {0.05, 0.02, -0.04}};
  const ImuPreintegration zero =
      PreintegrateImu(samples, 0, 500'000'000, ImuBias(), ImuNoise());
  const ImuPreintegration exact =
      PreintegrateImu(samples, 0, 500'000'000, bias, ImuNoise());
  // The remainder is quadratic, for the rotation (0.007 rad/s * 0.5 s)^2.
  EXPECT_LT(AngleBetweenRad(zero.CorrectedRotation(bias), exact.delta_rotation),
            2e-5);
  EXPECT_LT((zero.CorrectedVelocity(bias) - exact.delta_velocity).norm(), 1e-3);
  EXPECT_LT((zero.CorrectedPosition(bias) - exact.delta_position).norm(), 1e-3);
}

TEST(PreintegrateImu, CovarianceMatchesMonteCarlo) {
  const std::vector<ImuSample> clean = Sample(Motion(), 200.0, 0.5);
  const ImuNoise noise{1e-3, 0.0, 1e-2, 0.0};
  const timestamp_t end = 500'000'000;
  const ImuPreintegration truth =
      PreintegrateImu(clean, 0, end, ImuBias(), noise);
  const double root_rate = std::sqrt(200.0);
  Random random(5);
  Eigen::Matrix<double, 9, 9> sum = Eigen::Matrix<double, 9, 9>::Zero();
  constexpr int kNumRuns = 2000;
  for (int run = 0; run < kNumRuns; ++run) {
    std::vector<ImuSample> noisy = clean;
    for (ImuSample& sample : noisy) {
      sample.angular_velocity +=
          random.GaussianVector(noise.gyroscope_noise_density * root_rate);
      sample.specific_force +=
          random.GaussianVector(noise.accelerometer_noise_density * root_rate);
    }
    const ImuPreintegration imu =
        PreintegrateImu(noisy, 0, end, ImuBias(), noise);
    Eigen::Matrix<double, 9, 1> error;
    error << LogSo3(truth.delta_rotation.conjugate() * imu.delta_rotation),
        imu.delta_velocity - truth.delta_velocity,
        imu.delta_position - truth.delta_position;
    sum += error * error.transpose() / kNumRuns;
  }
  // Whitened, the sample covariance is the identity up to 1 / sqrt(runs).
  const Eigen::Matrix<double, 9, 9> l = truth.covariance.llt().matrixL();
  const Eigen::Matrix<double, 9, 9> inverse = l.inverse();
  const Eigen::Matrix<double, 9, 9> whitened =
      inverse * sum * inverse.transpose();
  // 5 sigma of a variance's estimate, and 2 % for the ends' half samples.
  const double tolerance = 5.0 * std::sqrt(2.0 / kNumRuns) + 0.02;
  EXPECT_LT((whitened - Eigen::Matrix<double, 9, 9>::Identity())
                .cwiseAbs()
                .maxCoeff(),
            tolerance);
}

TEST(PreintegrateImu, OneStepHasAFullRankCovariance) {
  const std::vector<ImuSample> samples = Sample(Motion(), 100.0, 0.1);
  const ImuPreintegration imu =
      PreintegrateImu(samples, 11'000'000, 12'000'000, ImuBias(), ImuNoise());
  const Eigen::LLT<Eigen::Matrix<double, 9, 9>> llt(imu.covariance);
  EXPECT_EQ(llt.info(), Eigen::Success);
}

TEST(PreintegrateImu, RefusesTimesOutsideTheLog) {
  const std::vector<ImuSample> samples = Sample(Motion(), 100.0, 0.1);
  EXPECT_THROW(PreintegrateImu(samples, -1, 50'000'000, ImuBias(), ImuNoise()),
               std::invalid_argument);
  EXPECT_THROW(PreintegrateImu(samples, 0, 200'000'000, ImuBias(), ImuNoise()),
               std::invalid_argument);
  EXPECT_THROW(PreintegrateImu({}, 0, 0, ImuBias(), ImuNoise()),
               std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
