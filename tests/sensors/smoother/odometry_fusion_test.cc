// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/odometry_fusion.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/smoother/chain_elimination.h"
#include "sensors/smoother/odometry_factors.h"

namespace adasfm {
namespace {

// A link with every sensor, around random values.
struct RandomLink {
  explicit RandomLink(uint64_t seed) {
    Random random(seed);
    std::vector<ImuSample> samples;
    for (int i = 0; i <= 40; ++i) {
      ImuSample sample;
      sample.timestamp_ns = timestamp_t{5'000'000} * i;
      sample.angular_velocity =
          Eigen::Vector3d(0.1, -0.2, 0.4) + random.GaussianVector(0.05);
      sample.specific_force =
          Eigen::Vector3d(0.5, 1.0, 9.7) + random.GaussianVector(0.3);
      samples.push_back(sample);
    }
    std::vector<WheelSpeed> speeds;
    for (int i = 0; i <= 10; ++i) {
      speeds.push_back({timestamp_t{20'000'000} * i, 5.0 + 0.1 * i, 0.4});
    }
    problem.imu_from_wheel = Rigid3d(ExpSo3(Eigen::Vector3d(0.1, -0.05, 0.3)),
                                     Eigen::Vector3d(0.4, -0.2, 0.3));
    std::vector<RotationAtTime> profile;
    link.dt_s = 0.2;
    link.has_imu = true;
    link.imu = PreintegrateImu(samples, 0, 200'000'000, ImuBias(), ImuNoise(),
                               &profile);
    link.has_wheel = true;
    link.has_wheel_yaw = true;
    link.wheel = PreintegrateWheel(speeds, 0, 200'000'000,
                                   problem.imu_from_wheel.rotation,
                                   WheelNoise(), profile);
    first.state.world_from_imu = ExpSo3(random.GaussianVector(0.5));
    second.state.world_from_imu = first.state.world_from_imu *
                                  link.imu.delta_rotation *
                                  ExpSo3(random.GaussianVector(0.02));
    for (ChainState* state : {&first, &second}) {
      state->state.velocity_in_imu =
          Eigen::Vector3d(5.0, 0.5, 0.1) + random.GaussianVector(0.2);
      state->state.bias.gyroscope = random.GaussianVector(0.01);
      state->state.bias.accelerometer = random.GaussianVector(0.1);
      state->step_in_previous =
          Eigen::Vector3d(1.0, 0.1, 0.0) + random.GaussianVector(0.1);
    }
    globals.values << 1.02, 0.97, 0.01, 0.03, -0.02, 0.04;
    link.rate_change =
        samples.back().angular_velocity - samples.front().angular_velocity;
  }

  OdometryFusionProblem problem;
  OdometryFusionOptions options;
  OdometryLink link;
  ChainState first, second;
  ChainGlobals globals;
};

Eigen::VectorXd ResidualsAfter(
    const RandomLink& r, const Eigen::Matrix<double, kLinkSize, 1>& delta) {
  ChainState first = r.first, second = r.second;
  ChainGlobals globals = r.globals;
  first.Retract(delta.head<ChainState::kSize>());
  second.Retract(delta.segment<ChainState::kSize>(ChainState::kSize));
  globals.values += delta.tail<ChainGlobals::kSize>();
  const LinkContext context{&r.problem, &r.options};
  return ComputeLinkResiduals(context, r.link, first, second, globals, 0.5)
      .values;
}

void ExpectJacobianIsNumeric(const RandomLink& r) {
  const LinkContext context{&r.problem, &r.options};
  const LinkResiduals residuals =
      ComputeLinkResiduals(context, r.link, r.first, r.second, r.globals, 0.5);
  constexpr double kStep = 1e-6;
  for (int column = 0; column < kLinkSize; ++column) {
    Eigen::Matrix<double, kLinkSize, 1> delta;
    delta.setZero();
    delta[column] = kStep;
    const Eigen::VectorXd numeric =
        (ResidualsAfter(r, delta) - ResidualsAfter(r, -delta)) / (2.0 * kStep);
    const double scale = 1.0 + numeric.norm();
    EXPECT_LT((numeric - residuals.jacobian.col(column)).norm(), 2e-4 * scale)
        << "column " << column;
  }
}

TEST(LinkResiduals, JacobianMatchesNumericDerivative) {
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    RandomLink r(seed);
    ExpectJacobianIsNumeric(r);
    r.link.standstill = StandstillKind::kAtRest;
    ExpectJacobianIsNumeric(r);
    r.link.standstill = StandstillKind::kNone;
    r.link.wheel.has_rotation = true;
    r.link.wheel.rotation = r.link.imu.delta_rotation;
    ExpectJacobianIsNumeric(r);
    r.link.wheel.has_rotation = false;
    r.link.has_vision = true;
    r.link.visual_rotation = r.link.imu.delta_rotation;
    r.link.visual_sigma_rad = 1e-3;
    ExpectJacobianIsNumeric(r);
    r.link.has_imu = false;
    ExpectJacobianIsNumeric(r);
    r.link.has_wheel = false;
    ExpectJacobianIsNumeric(r);
  }
}

// The heading of the world must not change any residual.
TEST(LinkResiduals, HeadingIsFree) {
  RandomLink r(6);
  const Eigen::VectorXd before =
      ResidualsAfter(r, Eigen::Matrix<double, kLinkSize, 1>::Zero());
  Eigen::Matrix<double, kLinkSize, 1> turn;
  turn.setZero();
  turn[ChainState::kRotation + 2] = 1.2;
  turn[ChainState::kSize + ChainState::kRotation + 2] = 1.2;
  EXPECT_LT((ResidualsAfter(r, turn) - before).norm(), 1e-6 * before.norm());
}

// A chain of random equations, solved block by block and all at once.
class ChainElimination : public testing::Test {
 protected:
  static constexpr int kState = ChainState::kSize;
  static constexpr int kNumLinks = 4;
  static constexpr int kNumStates = kNumLinks + 1;
  static constexpr int kSize = kNumStates * kState + ChainGlobals::kSize;

  void SetUp() override {
    Random random(7);
    dense_h_ = Eigen::MatrixXd::Zero(kSize, kSize);
    dense_g_ = Eigen::VectorXd::Zero(kSize);
    for (int k = 0; k < kNumLinks; ++k) {
      Eigen::Matrix<double, 50, kLinkSize> jacobian;
      Eigen::Matrix<double, 50, 1> values;
      for (int i = 0; i < 50; ++i) {
        values[i] = random.Gaussian(1.0);
        for (int j = 0; j < kLinkSize; ++j) {
          jacobian(i, j) = random.Gaussian(1.0);
        }
      }
      // Only the difference of headings matters, as in real links.
      jacobian.col(2) = -jacobian.col(kState + 2);
      links_.push_back(
          {jacobian.transpose() * jacobian, jacobian.transpose() * values});
      for (int i = 0; i < kLinkSize; ++i) {
        dense_g_[Index(k, i)] += links_[k].g[i];
        for (int j = 0; j < kLinkSize; ++j) {
          dense_h_(Index(k, i), Index(k, j)) += links_[k].h(i, j);
        }
      }
    }
    first_.h.diagonal().setConstant(0.5);
    first_.g.setConstant(0.1);
    for (int i = 0; i < ChainMessage::kSize; ++i) {
      const int index = i < kState ? i : kNumStates * kState + i - kState;
      dense_h_(index, index) += first_.h(i, i);
      dense_g_[index] += first_.g[i];
    }
  }

  static int Index(int link, int coordinate) {
    return coordinate < 2 * kState
               ? link * kState + coordinate
               : kNumStates * kState + coordinate - 2 * kState;
  }

  std::vector<LinkEquations> links_;
  ChainMessage first_;
  Eigen::MatrixXd dense_h_;
  Eigen::VectorXd dense_g_;
};

TEST_F(ChainElimination, SolutionEqualsTheDenseOne) {
  const ChainSolution solution = SolveChain(
      kNumLinks, first_, [this](size_t k) { return links_[k]; }, 0.0);
  const Eigen::VectorXd dense = -dense_h_.llt().solve(dense_g_);
  for (int k = 0; k < kNumStates; ++k) {
    EXPECT_LT((solution.states[k] - dense.segment<kState>(k * kState)).norm(),
              1e-9);
  }
  EXPECT_LT((solution.globals - dense.tail<ChainGlobals::kSize>()).norm(),
            1e-9);
}

TEST_F(ChainElimination, CovariancesEqualTheDenseOnes) {
  // A prior of the heading would be information that real links do not have.
  first_.h.row(2).setZero();
  first_.h.col(2).setZero();
  first_.h(2, 2) = 1e-12;
  dense_h_(2, 2) += 1e-12 - 0.5;
  ComputeChainCovariances(
      kNumLinks, first_, [this](size_t k) { return links_[k]; },
      [this](size_t k, const LinkCovariance& covariance) {
        // Fixes the heading of state k.
        Eigen::MatrixXd h = dense_h_;
        h(k * kState + 2, k * kState + 2) += 1e12;
        const Eigen::MatrixXd dense = h.inverse();
        for (int i = 0; i < kLinkSize; ++i) {
          for (int j = 0; j < kLinkSize; ++j) {
            EXPECT_NEAR(covariance(i, j), dense(Index(k, i), Index(k, j)), 1e-7)
                << k << " " << i << " " << j;
          }
        }
      });
}

TEST(FuseOdometry, RefusesWrongSizesAndOptions) {
  OdometryFusionProblem problem;
  problem.links.resize(2);
  problem.initial_states.resize(2);
  EXPECT_THROW(FuseOdometry(problem, OdometryFusionOptions()),
               std::invalid_argument);
  problem.initial_states.resize(3);
  OdometryFusionOptions options;
  options.gravity_m_s2 = 0.0;
  EXPECT_THROW(FuseOdometry(problem, options), std::invalid_argument);
  std::string error;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("gravity_m_s2"), std::string::npos);
}

TEST(FuseOdometry, ALinkWithoutSensorsStaysFinite) {
  OdometryFusionProblem problem;
  problem.links.resize(2);
  for (OdometryLink& link : problem.links) link.dt_s = 0.1;
  problem.initial_states.resize(3);
  const OdometryFusionResult result =
      FuseOdometry(problem, OdometryFusionOptions());
  for (const OdometryMotion& motion : result.motions) {
    EXPECT_TRUE(motion.covariance.allFinite());
    EXPECT_TRUE(motion.body2_from_body1.translation.allFinite());
  }
}

}  // namespace
}  // namespace adasfm
