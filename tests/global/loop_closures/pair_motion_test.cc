// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/pair_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "core/so3.h"
#include "global/odometry/odometry_chain.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

TEST(ChiSquare, ProbabilityOfTables) {
  EXPECT_NEAR((ChiSquare{7.815, 3}.Probability()), 0.05, 1e-4);
  EXPECT_NEAR((ChiSquare{11.070, 5}.Probability()), 0.05, 1e-4);
  EXPECT_NEAR((ChiSquare{12.592, 6}.Probability()), 0.05, 1e-4);
  EXPECT_NEAR((ChiSquare{34.0, 6}.Probability()), 6.7e-6, 1e-6);
  EXPECT_NEAR((ChiSquare{0.0, 5}.Probability()), 1.0, 1e-9);
  EXPECT_EQ((ChiSquare{50.0, 0}.Probability()), 1.0);
}

// A drive round a block: 1 m and 0.1 s a step.
Rigid3d TrueStep(int k) {
  const double turn = k % 40 < 8 ? kPi / 16 : 0.0;
  return Rigid3d(ExpSo3(Eigen::Vector3d(0.0, turn, 0.0)),
                 Eigen::Vector3d(0.0, 0.0, -1.0));
}

constexpr int kNumSteps = 150;

// The logs of that drive with all shared errors drawn from the options.
std::vector<RelativePosePrior> DrawLogs(const OdometryChainOptions& options,
                                        Random* random) {
  constexpr double kStepSeconds = 0.1;
  const double scale = 1.0 + random->Gaussian(options.scale_sigma);
  Eigen::Vector3d bias = random->GaussianVector(options.gyro_bias_sigma_rad_s);
  const Eigen::Quaterniond extrinsic =
      ExpSo3(random->GaussianVector(options.extrinsic_rotation_sigma_rad));
  const Eigen::Quaterniond driving =
      ExpSo3(random->GaussianVector(options.driving_direction_sigma_rad));
  const Eigen::Vector3d gyro_scales =
      random->GaussianVector(options.gyro_scale_sigma);
  std::vector<RelativePosePrior> priors;
  for (int k = 1; k <= kNumSteps; ++k) {
    Rigid3d step = TrueStep(k);
    step.rotation =
        ExpSo3(gyro_scales.cwiseProduct(LogSo3(step.rotation))) * step.rotation;
    step.rotation = ExpSo3(kStepSeconds * bias) * extrinsic * step.rotation *
                    extrinsic.conjugate();
    step.translation = scale * (driving * step.translation);
    priors.push_back(BuildPrior(k, k + 1, step, 3e-4, 0.005, random));
    bias += random->GaussianVector(options.gyro_bias_walk_rad_s_sqrt_s *
                                   std::sqrt(kStepSeconds));
  }
  return priors;
}

// The relative pose of two images with the noise of its own edge.
ViewGraphEdge DrawPair(int i, int j, double* length, Random* random) {
  Rigid3d motion;
  for (int k = i; k < j; ++k) motion = TrueStep(k) * motion;
  const double angle = DegToRad(kPairAngleSigmaDeg);
  *length = motion.translation.norm();
  const Eigen::Vector3d direction = motion.translation / *length;
  motion.rotation = ExpSo3(random->GaussianVector(angle)) * motion.rotation;
  motion.translation =
      (direction + random->GaussianVector(angle).cross(direction)).normalized();
  *length *= 1.0 + random->Gaussian(kPairLengthLogSigma);
  ViewGraphEdge edge = BuildEdge(ImagePair(i, j), motion);
  edge.rotation_sigma_rad = 0.0;
  edge.direction_sigma_rad = 0.0;
  return edge;
}

OdometryChainOptions ErrorsOfEqualWeight() {
  OdometryChainOptions options;
  options.scale_sigma = 0.01;
  options.gyro_bias_sigma_rad_s = 1e-3;
  options.gyro_bias_walk_rad_s_sqrt_s = 5e-4;
  options.gyro_scale_sigma = 0.01;
  options.extrinsic_rotation_sigma_rad = 0.01;
  options.driving_direction_sigma_rad = 0.01;
  options.persistent_translation_ratio = 0.0;
  return options;
}

// The share of true pairs below the probability level, one pair a drive.
double RefusedShare(double probability, bool has_length,
                    const OdometryChainOptions& drawn,
                    const OdometryChainOptions& believed, uint64_t seed) {
  constexpr int kNumDrives = 400;
  Random random(seed);
  int num_refused = 0;
  for (int k = 0; k < kNumDrives; ++k) {
    const OdometryChain chain(DrawLogs(drawn, &random), believed);
    double length = 0.0;
    const ViewGraphEdge edge = DrawPair(5, 125, &length, &random);
    const PairMotion pair = MeasurePair(
        edge,
        has_length ? std::optional<EdgeLength>(EdgeLength{length, 0.0})
                   : std::nullopt,
        0.0);
    num_refused +=
        TestByOdometry(chain, edge, pair).Probability() < probability;
  }
  return static_cast<double>(num_refused) / kNumDrives;
}

// True pairs are rejected at the stated level. The tolerances are four standard
// errors of a share of 400 drives: 0.011 for 0.05, 0.02 for 0.2.
TEST(TestByOdometry, RefusesTruePairsAtTheStatedLevel) {
  const OdometryChainOptions errors = ErrorsOfEqualWeight();
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    for (const bool has_length : {true, false}) {
      const double at_5 = RefusedShare(0.05, has_length, errors, errors, seed);
      EXPECT_GT(at_5, 0.05 - 0.04) << seed << has_length;
      EXPECT_LT(at_5, 0.05 + 0.04) << seed << has_length;
      const double at_20 = RefusedShare(0.2, has_length, errors, errors, seed);
      EXPECT_GT(at_20, 0.2 - 0.08) << seed << has_length;
      EXPECT_LT(at_20, 0.2 + 0.08) << seed << has_length;
    }
  }
}

// Each shared error counts: without it far more true pairs are rejected.
TEST(TestByOdometry, EachSharedErrorIsInTheCovariance) {
  using Change = std::function<void(OdometryChainOptions*)>;
  const std::vector<Change> leave_out = {
      [](auto* o) { o->scale_sigma = 0.0; },
      [](auto* o) { o->gyro_bias_sigma_rad_s = 0.0; },
      [](auto* o) { o->gyro_bias_walk_rad_s_sqrt_s = 0.0; },
      [](auto* o) { o->gyro_scale_sigma = 0.0; },
      [](auto* o) { o->extrinsic_rotation_sigma_rad = 0.0; },
      [](auto* o) { o->driving_direction_sigma_rad = 0.0; }};
  for (size_t k = 0; k < leave_out.size(); ++k) {
    OdometryChainOptions drawn = ErrorsOfEqualWeight();
    // Only this error is drawn, larger than what a pair's own noise covers.
    for (size_t other = 0; other < leave_out.size(); ++other) {
      if (other != k) leave_out[other](&drawn);
    }
    drawn.scale_sigma *= 8.0;
    drawn.gyro_bias_sigma_rad_s *= 8.0;
    drawn.gyro_bias_walk_rad_s_sqrt_s *= 8.0;
    drawn.gyro_scale_sigma *= 2.0;              // the same
    drawn.extrinsic_rotation_sigma_rad *= 2.0;  // has second-order terms
    drawn.driving_direction_sigma_rad *= 8.0;
    OdometryChainOptions without = drawn;
    leave_out[k](&without);
    EXPECT_LT(RefusedShare(0.01, true, drawn, drawn, 1), 0.04) << k;
    EXPECT_GT(RefusedShare(0.01, true, drawn, without, 1), 0.15) << k;
  }
}

// Without a length a pair is rejected if its direction contradicts the
// prediction, but at no distance along that direction.
TEST(TestPair, UnknownLengthTestsTheDirection) {
  UncertainMotion predicted;
  predicted.cam2_from_cam1.translation = Eigen::Vector3d(0.0, 0.0, 30.0);
  predicted.covariance.diagonal().setConstant(1e-4);
  const auto test = [&predicted](const Eigen::Vector3d& direction) {
    ViewGraphEdge edge = BuildEdge(
        ImagePair(1, 2), Rigid3d(Eigen::Quaterniond::Identity(), direction));
    edge.direction_sigma_rad = 0.005;
    return TestPair(MeasurePair(edge, std::nullopt, 1.0), predicted, true);
  };
  EXPECT_EQ(test(Eigen::Vector3d::UnitZ()).dof, 5);
  EXPECT_GT(test(Eigen::Vector3d::UnitZ()).Probability(), 0.9);
  EXPECT_LT(test(Eigen::Vector3d(0.1, 0.0, 1.0).normalized()).Probability(),
            1e-9);
  EXPECT_LT(test(-Eigen::Vector3d::UnitZ()).Probability(), 1e-9);
}

TEST(MeasurePair, GrantsTheLeastErrors) {
  ViewGraphEdge edge = BuildEdge(
      ImagePair(1, 2),
      Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d::UnitZ()));
  edge.rotation_sigma_rad = 0.0;
  edge.direction_sigma_rad = 0.0;
  const PairMotion pair = MeasurePair(edge, EdgeLength{10.0, 0.04}, 0.0);
  const Eigen::Matrix<double, 6, 1> sigmas =
      pair.motion.covariance.diagonal().cwiseSqrt();
  EXPECT_NEAR(sigmas(0), DegToRad(0.5), 1e-9);
  EXPECT_NEAR(sigmas(3), 10.0 * DegToRad(0.5), 1e-9);
  // 0.03 and the length's own 0.04.
  EXPECT_NEAR(sigmas(5), 10.0 * 0.05, 1e-9);
}

// Without a baseline only the rotation is tested.
TEST(TestPair, NoBaselineTestsTheRotation) {
  ViewGraphEdge edge = BuildEdge(ImagePair(1, 2), Rigid3d());
  edge.has_baseline = false;
  const PairMotion pair = MeasurePair(edge, std::nullopt, 1.0);
  UncertainMotion predicted;
  predicted.covariance.diagonal().setConstant(1e-4);
  predicted.cam2_from_cam1.translation.x() = 2.0;
  EXPECT_EQ(TestPair(pair, predicted, true).dof, 3);
  EXPECT_GT(TestPair(pair, predicted, true).Probability(), 0.5);
  predicted.cam2_from_cam1.rotation = ExpSo3(Eigen::Vector3d(0.0, 0.3, 0.0));
  EXPECT_LT(TestPair(pair, predicted, true).Probability(), 1e-9);
}

}  // namespace
}  // namespace adasfm
