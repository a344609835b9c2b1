// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry_chain.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "core/so3.h"
#include "tests/global/test_scene.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// A bent drive: 1 m a step.
Rigid3d TrueStep(int k) {
  return Rigid3d(ExpSo3(Eigen::Vector3d(0.002, 0.03 * std::sin(0.05 * k), 0)),
                 Eigen::Vector3d(0.02, 0.01, -1.0));
}

TEST(OdometryChain, ComposesBothWays) {
  Random random(1);
  std::vector<RelativePosePrior> priors;
  for (int k = 1; k < 30; ++k) {
    priors.push_back(BuildPrior(k, k + 1, TrueStep(k), 0, 0, &random));
  }
  const OdometryChain chain(priors, OdometryChainOptions());
  Rigid3d expected;
  for (int k = 5; k < 20; ++k) expected = TrueStep(k) * expected;
  EXPECT_TRUE(
      PosesNear(chain.Motion(5, 20).cam2_from_cam1, expected, 1e-9, 1e-9));
  EXPECT_TRUE(PosesNear(chain.Motion(20, 5).cam2_from_cam1, expected.Inverse(),
                        1e-9, 1e-9));
  EXPECT_EQ(chain.NumSteps(5, 20), 15);
  EXPECT_EQ(chain.NumSteps(20, 5), -15);
}

TEST(OdometryChain, BreaksWherePriorsAreMissing) {
  Random random(1);
  std::vector<RelativePosePrior> priors;
  for (int k = 1; k < 10; ++k) {
    if (k == 5) continue;
    priors.push_back(BuildPrior(k, k + 1, TrueStep(k), 0, 0, &random));
  }
  priors[1].flags = kPriorRotation;
  const OdometryChain chain(priors, OdometryChainOptions());
  EXPECT_TRUE(chain.IsConnected(1, 5));
  EXPECT_FALSE(chain.IsConnected(5, 6));
  EXPECT_FALSE(chain.IsConnected(1, 77));
  EXPECT_THROW(chain.Motion(5, 6), std::invalid_argument);
  EXPECT_TRUE(chain.Motion(1, 5).has_rotation);
  EXPECT_FALSE(chain.Motion(1, 5).has_position);
  EXPECT_TRUE(chain.Motion(3, 5).has_position);
}

// Draws chains with white noise and common errors; their spread must be the
// covariance that the chain states.
TEST(OdometryChain, CovarianceAgreesWithMonteCarlo) {
  constexpr int kNumSteps = 120;
  constexpr int kNumDraws = 1500;
  constexpr double kRotationSigma = 2e-4;
  constexpr double kTranslationSigma = 0.01;
  OdometryChainOptions options;
  options.scale_sigma = 0.004;
  options.gyro_bias_sigma_rad_s = 5e-4;
  options.persistent_translation_ratio = 0.3;
  Random random(7);
  const auto draw = [&](double rotation_sigma, double translation_sigma,
                        double scale, const Eigen::Vector3d& bias,
                        const Eigen::Vector3d& persistent) {
    std::vector<RelativePosePrior> priors;
    for (int k = 1; k <= kNumSteps; ++k) {
      Rigid3d step = TrueStep(k);
      step.rotation = ExpSo3(0.1 * bias) * step.rotation;
      step.translation = scale * step.translation + persistent;
      priors.push_back(BuildPrior(k, k + 1, step, rotation_sigma,
                                  translation_sigma, &random));
      priors.back().covariance.diagonal()
          << Eigen::Vector3d::Constant(kRotationSigma * kRotationSigma),
          Eigen::Vector3d::Constant(kTranslationSigma * kTranslationSigma);
    }
    return OdometryChain(priors, options);
  };
  const OdometryChain truth =
      draw(0, 0, 1.0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  for (const auto& [from, to] :
       std::vector<std::pair<image_t, image_t>>{{11, 111}, {111, 31}}) {
    Matrix6d sampled = Matrix6d::Zero();
    const ChainMotion expected = truth.Motion(from, to);
    for (int k = 0; k < kNumDraws; ++k) {
      const Rigid3d drawn =
          draw(kRotationSigma, kTranslationSigma,
               1.0 + random.Gaussian(options.scale_sigma),
               random.GaussianVector(options.gyro_bias_sigma_rad_s),
               random.GaussianVector(options.persistent_translation_ratio *
                                     kTranslationSigma))
              .Motion(from, to)
              .cam2_from_cam1;
      Eigen::Matrix<double, 6, 1> error;
      error << LogSo3(drawn.rotation *
                      expected.cam2_from_cam1.rotation.conjugate()),
          drawn.translation - expected.cam2_from_cam1.translation;
      sampled += error * error.transpose() / kNumDraws;
    }
    // In the frame in which the stated covariance is the identity, sampled
    // variances have a standard error of sqrt(2 / n) = 3.7 %.
    const Matrix6d whitener =
        Matrix6d(expected.covariance.llt().matrixL()).inverse();
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(whitener * sampled *
                                                        whitener.transpose());
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.8);
    EXPECT_LT(eigen.eigenvalues().maxCoeff(), 1.2);
  }
}

}  // namespace
}  // namespace adasfm
