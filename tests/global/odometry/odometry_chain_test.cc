// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/odometry_chain.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// A bent drive: 1 m a step.
Rigid3d TrueStep(int k) {
  return Rigid3d(ExpSo3(Eigen::Vector3d(0.002, 0.03 * std::sin(0.05 * k), 0)),
                 Eigen::Vector3d(0.02, 0.01, -1.0));
}

Eigen::Matrix<double, 6, 1> ErrorOf(const Rigid3d& motion,
                                    const Rigid3d& expected) {
  Eigen::Matrix<double, 6, 1> error;
  error << LogSo3(motion.rotation * expected.rotation.conjugate()),
      motion.translation - expected.translation;
  return error;
}

// In the frame in which the stated covariance is the identity, variances of
// 1,500 draws have a standard error of sqrt(2 / n) = 3.7 %.
void ExpectSpread(const Matrix6d& stated, const Matrix6d& sampled) {
  const Matrix6d whitener = Matrix6d(stated.llt().matrixL()).inverse();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(whitener * sampled *
                                                      whitener.transpose());
  EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.8);
  EXPECT_LT(eigen.eigenvalues().maxCoeff(), 1.2);
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

TEST(OdometryChain, FollowersHaveTheirLeadersPlace) {
  Random random(1);
  const Rigid3d cam_from_rig(ExpSo3(Eigen::Vector3d(0.1, -1.2, 0.2)),
                             Eigen::Vector3d(-0.5, 0.1, 0.2));
  std::vector<RelativePosePrior> priors, frame_priors;
  for (int k = 1; k < 10; ++k) {
    priors.push_back(BuildPrior(k, k + 1, TrueStep(k), 1e-3, 0.02, &random));
    frame_priors.push_back(BuildPrior(k, 100 + k, cam_from_rig, 0, 0, &random));
    frame_priors.back().covariance.setIdentity();
    frame_priors.back().covariance *= 1e-6;
  }
  const OdometryChain chain(priors, OdometryChainOptions(), frame_priors);
  const ChainMotion leaders = chain.Motion(3, 8);
  EXPECT_TRUE(chain.IsFollower(103));
  EXPECT_FALSE(chain.IsFollower(3));
  EXPECT_EQ(chain.Index(103), chain.Index(3));
  EXPECT_EQ(chain.NumSteps(103, 8), 5);
  EXPECT_EQ(chain.NumSteps(3, 103), 0);
  EXPECT_TRUE(PosesNear(chain.CamFromStart(108),
                        cam_from_rig * chain.CamFromStart(8), 1e-9, 1e-9));
  const ChainMotion followers = chain.Motion(103, 108);
  EXPECT_TRUE(followers.has_rotation);
  EXPECT_TRUE(followers.has_position);
  EXPECT_TRUE(
      PosesNear(followers.cam2_from_cam1,
                cam_from_rig * leaders.cam2_from_cam1 * cam_from_rig.Inverse(),
                1e-9, 1e-9));
  // The extrinsics' errors of 1 mrad add to those of the odometry.
  const auto rotation_variance = [](const ChainMotion& motion) {
    return Eigen::Matrix3d(motion.covariance.topLeftCorner<3, 3>()).trace();
  };
  EXPECT_NEAR(rotation_variance(followers),
              rotation_variance(leaders) + 2 * 3e-6, 1e-12);
  const ChainMotion within = chain.Motion(3, 103);
  EXPECT_TRUE(PosesNear(within.cam2_from_cam1, cam_from_rig, 1e-9, 1e-9));
  EXPECT_TRUE(within.covariance.isApprox(frame_priors[0].covariance, 1e-9));
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
  options.gyro_bias_walk_rad_s_sqrt_s = 3e-4;
  options.gyro_scale_sigma = 0.003;
  options.extrinsic_rotation_sigma_rad = 0.004;
  options.driving_direction_sigma_rad = 0.003;
  options.persistent_translation_ratio = 0.3;
  Random random(7);
  // noise: 0 for the truth. The bias has the stated sigma at the earlier image
  // and walks from there on.
  const auto draw = [&](double noise, int earlier) {
    const double scale = 1.0 + noise * random.Gaussian(options.scale_sigma);
    Eigen::Vector3d bias =
        noise * random.GaussianVector(options.gyro_bias_sigma_rad_s);
    const Eigen::Vector3d extrinsic =
        noise * random.GaussianVector(options.extrinsic_rotation_sigma_rad);
    const Eigen::Quaterniond driving = ExpSo3(
        noise * random.GaussianVector(options.driving_direction_sigma_rad));
    const Eigen::Vector3d gyro_scales =
        noise * random.GaussianVector(options.gyro_scale_sigma);
    const Eigen::Vector3d persistent =
        noise * random.GaussianVector(options.persistent_translation_ratio *
                                      kTranslationSigma);
    std::vector<RelativePosePrior> priors;
    for (int k = 1; k <= kNumSteps; ++k) {
      Rigid3d step = TrueStep(k);
      step.rotation =
          ExpSo3(0.1 * bias + extrinsic - step.rotation * extrinsic +
                 gyro_scales.cwiseProduct(LogSo3(step.rotation))) *
          step.rotation;
      step.translation = scale * (driving * step.translation) + persistent;
      priors.push_back(BuildPrior(k, k + 1, step, noise * kRotationSigma,
                                  noise * kTranslationSigma, &random));
      priors.back().covariance.diagonal()
          << Eigen::Vector3d::Constant(kRotationSigma * kRotationSigma),
          Eigen::Vector3d::Constant(kTranslationSigma * kTranslationSigma);
      if (k < earlier) continue;
      bias += noise * random.GaussianVector(
                          options.gyro_bias_walk_rad_s_sqrt_s * std::sqrt(0.1));
    }
    return OdometryChain(priors, options);
  };
  const OdometryChain truth = draw(0.0, 0);
  for (const auto& [from, to] :
       std::vector<std::pair<image_t, image_t>>{{11, 111}, {111, 31}}) {
    Matrix6d sampled = Matrix6d::Zero();
    const ChainMotion expected = truth.Motion(from, to);
    for (int k = 0; k < kNumDraws; ++k) {
      const Rigid3d drawn =
          draw(1.0, std::min(from, to)).Motion(from, to).cam2_from_cam1;
      const Eigen::Matrix<double, 6, 1> error =
          ErrorOf(drawn, expected.cam2_from_cam1);
      sampled += error * error.transpose() / kNumDraws;
    }
    ExpectSpread(expected.covariance, sampled);
  }
}

// Shared rotations that vision has found are removed, and the errors that
// remain must agree with their covariance. The drive goes up a helix; its
// priors have camera-IMU rotation and direction of driving wrong together.
TEST(OdometryChain, SharedErrorsAgreeWithMonteCarlo) {
  constexpr int kNumSteps = 120;
  constexpr int kNumDraws = 1500;
  Random random(11);
  SharedRotationErrors found;
  found.camera_imu_rad = Eigen::Vector3d(0.01, -0.02, 0.005);
  found.driving_direction_rad = Eigen::Vector3d(-0.015, 0.01, 0.02);
  Matrix6d root = Matrix6d::Zero();
  for (int k = 0; k < 36; ++k) root(k / 6, k % 6) = random.Gaussian(0.001);
  root.bottomLeftCorner<3, 3>() += root.topLeftCorner<3, 3>();
  found.covariance = root * root.transpose();
  OdometryChainOptions options;
  options.scale_sigma = 0.0;
  options.gyro_bias_sigma_rad_s = 0.0;
  options.gyro_bias_walk_rad_s_sqrt_s = 0.0;
  options.gyro_scale_sigma = 0.0;
  options.persistent_translation_ratio = 0.0;
  // Isotropic: rotations of all steps do not change it to first order.
  const double variance = 1e-8;
  std::vector<RelativePosePrior> truth;
  for (int k = 1; k <= kNumSteps; ++k) {
    truth.push_back(BuildPrior(k, k + 1, TrueStep(k), 0, 0, &random));
    truth.back().covariance = variance * Matrix6d::Identity();
  }
  const ChainMotion expected = OdometryChain(truth, options).Motion(11, 111);
  // Priors that these rotations correct to the truth.
  const auto turn_away = [&](const Eigen::Vector3d& camera_imu_rad,
                             const Eigen::Vector3d& driving_rad) {
    std::vector<RelativePosePrior> priors = truth;
    const Eigen::Quaterniond camera_imu = ExpSo3(camera_imu_rad);
    for (RelativePosePrior& prior : priors) {
      Rigid3d& motion = prior.cam2_from_cam1;
      const Eigen::Quaterniond middle = ExpSo3(0.5 * LogSo3(motion.rotation));
      motion.translation = ExpSo3(middle * -driving_rad) * motion.translation;
      motion.rotation = camera_imu.conjugate() * motion.rotation * camera_imu;
    }
    return priors;
  };
  options.shared_rotation_errors[0] = found;
  const ChainMotion stated =
      OdometryChain(
          turn_away(found.camera_imu_rad, found.driving_direction_rad), options)
          .Motion(11, 111);
  EXPECT_TRUE(
      PosesNear(stated.cam2_from_cam1, expected.cam2_from_cam1, 1e-9, 1e-9));
  Matrix6d sampled = Matrix6d::Zero();
  for (int k = 0; k < kNumDraws; ++k) {
    Eigen::Matrix<double, 6, 1> normal;
    normal << random.GaussianVector(1.0), random.GaussianVector(1.0);
    const Eigen::Matrix<double, 6, 1> drawn = root * normal;
    std::vector<RelativePosePrior> priors =
        turn_away(found.camera_imu_rad + drawn.head<3>(),
                  found.driving_direction_rad + drawn.tail<3>());
    for (RelativePosePrior& prior : priors) {
      Rigid3d& step = prior.cam2_from_cam1;
      step.rotation =
          ExpSo3(random.GaussianVector(std::sqrt(variance))) * step.rotation;
      step.translation += random.GaussianVector(std::sqrt(variance));
    }
    const Rigid3d motion =
        OdometryChain(priors, options).Motion(11, 111).cam2_from_cam1;
    const Eigen::Matrix<double, 6, 1> error =
        ErrorOf(motion, expected.cam2_from_cam1);
    sampled += error * error.transpose() / kNumDraws;
  }
  ExpectSpread(stated.covariance, sampled);
}

// The stated bias covariance is used for each axis: the rotation error is the
// rate error times the time.
TEST(OdometryChain, StatedBiasReplacesTheAssumedOne) {
  Random random(7);
  std::vector<RelativePosePrior> priors;
  for (int k = 1; k <= 50; ++k) {
    Rigid3d step;
    step.translation = Eigen::Vector3d(0.0, 0.0, -1.0);
    priors.push_back(BuildPrior(k, k + 1, step, 0, 0, &random));
    priors.back().covariance = 1e-12 * Matrix6d::Identity();
  }
  OdometryChainOptions options;
  options.gyro_bias_walk_rad_s_sqrt_s = 0.0;
  const double assumed =
      OdometryChain(priors, options).Motion(1, 51).covariance(1, 1);
  options.gyro_bias_covariance =
      Eigen::Vector3d(1e-8, 4e-6, 1e-10).asDiagonal();
  const Matrix6d stated =
      OdometryChain(priors, options).Motion(1, 51).covariance;
  const double seconds = 50 * SecondsFromNs(priors[0].dt_ns);
  EXPECT_NEAR(assumed, 4e-8 * seconds * seconds, 1e-9);
  EXPECT_NEAR(stated(1, 1), 4e-6 * seconds * seconds, 1e-9);
  EXPECT_NEAR(stated(0, 0), 1e-8 * seconds * seconds, 1e-9);
}

// The scale is a random walk over the steps, so a drive round a block does not
// close.
TEST(OdometryChain, ScaleDriftAgreesWithMonteCarlo) {
  constexpr int kNumSteps = 120;
  constexpr int kNumDraws = 1500;
  OdometryChainOptions options;
  options.scale_sigma = 0.0;
  options.gyro_bias_sigma_rad_s = 0.0;
  options.gyro_bias_walk_rad_s_sqrt_s = 0.0;
  options.extrinsic_rotation_sigma_rad = 0.0;
  options.driving_direction_sigma_rad = 0.0;
  options.scale_drift_ratio = 0.01;
  Random random(7);
  const auto draw = [&](double drift_ratio) {
    std::vector<RelativePosePrior> priors;
    double scale = 1.0;
    for (int k = 1; k <= kNumSteps; ++k) {
      Rigid3d step = TrueStep(k);
      step.rotation = ExpSo3(Eigen::Vector3d(0.0, 0.05, 0.0)) * step.rotation;
      scale *= std::exp(random.Gaussian(drift_ratio));
      step.translation *= scale;
      priors.push_back(BuildPrior(k, k + 1, step, 0, 0, &random));
      priors.back().covariance = 1e-8 * Matrix6d::Identity();
    }
    return OdometryChain(priors, options);
  };
  const OdometryChain truth = draw(0.0);
  for (const auto& [from, to] :
       std::vector<std::pair<image_t, image_t>>{{1, 116}, {111, 31}}) {
    const ChainMotion expected = truth.Motion(from, to);
    const Eigen::Matrix3d covariance =
        expected.covariance.bottomRightCorner<3, 3>();
    Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
    for (int k = 0; k < kNumDraws; ++k) {
      const OdometryChain drawn = draw(options.scale_drift_ratio);
      // The scale up to the earlier image is common to all steps; only its
      // change since then is an error of the chain.
      const image_t earlier = std::min(from, to);
      const double scale =
          drawn.Motion(earlier, earlier + 1).cam2_from_cam1.translation.norm() /
          truth.Motion(earlier, earlier + 1).cam2_from_cam1.translation.norm();
      const Eigen::Vector3d error =
          drawn.Motion(from, to).cam2_from_cam1.translation / scale -
          expected.cam2_from_cam1.translation;
      sampled += error * error.transpose() / kNumDraws;
    }
    // See ExpectSpread; a drift of 10 % after 100 steps is not quite linear.
    const Eigen::Matrix3d whitener =
        Eigen::Matrix3d(covariance.llt().matrixL()).inverse();
    const Eigen::Vector3d eigenvalues =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(whitener * sampled *
                                                       whitener.transpose())
            .eigenvalues();
    EXPECT_LT(eigenvalues.maxCoeff(), 1.25);
    EXPECT_NEAR(sampled.trace(), covariance.trace(), 0.2 * covariance.trace());
  }
}

}  // namespace
}  // namespace adasfm
