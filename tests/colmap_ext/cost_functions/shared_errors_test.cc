// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/shared_errors.h"

#include <gtest/gtest.h>

#include <functional>
#include <utility>

#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

// A drive whose gyroscope has a constant bias and whose direction of driving
// differs from that of T_imu_wheel.
std::vector<PosePriorEdge> BiasedPriors(const BundleWorldOptions& options,
                                        const SharedErrors& errors,
                                        Random* random) {
  std::vector<PosePriorEdge> edges = TruePriors(options);
  for (PosePriorEdge& edge : edges) {
    edge.dt_s = 0.3;
    edge.rotation_sigma_rad = 2e-4;
    edge.direction_sigma_rad = 5e-3;
    edge.length_sigma_m = 0.02;
    // To first order, correcting by the errors of opposite sign adds them.
    SharedErrors opposite;
    opposite.gyroscope_bias[0] = -errors.gyroscope_bias.at(0);
    opposite.driving_direction[0] = -errors.driving_direction.at(0);
    Rigid3d& motion = edge.cam2_from_cam1;
    motion = opposite.Correct(motion, edge.dt_s, {});
    motion.rotation = (ExpSo3(random->GaussianVector(edge.rotation_sigma_rad)) *
                       motion.rotation)
                          .normalized();
    motion.translation += random->GaussianVector(edge.direction_sigma_rad *
                                                 motion.translation.norm());
    motion.translation *=
        1.0 + random->Gaussian(edge.length_sigma_m) / motion.translation.norm();
  }
  return edges;
}

SharedErrors LargeSharedErrors() {
  SharedErrors errors;
  errors.gyroscope_bias[0] = Eigen::Vector3d(1e-4, -1e-3, 2e-4);
  errors.driving_direction[0] = Eigen::Vector3d(0.01, 0.02, 0.0);
  return errors;
}

TEST(SharedErrorsTest, FindsTheErrorsThatAllPriorsShare) {
  // A long drive with few points: vision alone allows bends, and the priors
  // decide.
  BundleWorldOptions world;
  world.num_images = 200;
  world.num_keypoints_per_image = 40;
  world.pixel_noise_px = 0.3;
  const SharedErrors truth = LargeSharedErrors();
  for (const uint64_t seed : {1, 2, 3}) {
    world.seed = seed;
    Random random(seed);
    colmap::Reconstruction given = BuildBundleWorld(world);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
    problem.priors = BiasedPriors(world, truth, &random);
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.keypoint_sigma_px = world.pixel_noise_px;
    colmap::Reconstruction with = given;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundle(options, problem, &with);
    ASSERT_TRUE(summary.success);
    options.shared_errors.enabled = false;
    colmap::Reconstruction without = given;
    ASSERT_TRUE(AdjustBundle(options, problem, &without).success);
    EXPECT_LT(AlignedCenterError(world, with),
              0.8 * AlignedCenterError(world, without));
    // Vision with so few points determines the bias to about 6e-4 rad/s
    // (measured at several noises), its prior to 1e-3. A constant bias is found
    // to a third of its size, and the direction to the 2e-3 rad by which such a
    // bias rotates it.
    EXPECT_NEAR(summary.shared_errors.gyroscope_bias.at(0).y(), -1e-3, 4e-4);
    EXPECT_NEAR(summary.shared_errors.driving_direction.at(0).y(), 0.02, 2e-3);
    EXPECT_NEAR(summary.shared_errors.driving_direction.at(0).x(), 0.01, 2e-3);
  }
}

// Two machines, one after the other, with errors of opposite sign and wheels of
// different scale.
TEST(SharedErrorsTest, EachDriveHasItsOwn) {
  BundleWorldOptions world;
  world.num_images = 200;
  // Enough points for vision to compare the lengths of both halves.
  world.num_keypoints_per_image = 160;
  world.pixel_noise_px = 0.3;
  constexpr double kScale = 0.01;
  SharedErrors second = LargeSharedErrors();
  second.gyroscope_bias[0] *= -1.0;
  second.driving_direction[0] *= -1.0;
  for (const uint64_t seed : {1, 2, 3}) {
    world.seed = seed;
    Random random(seed);
    const colmap::Reconstruction given = BuildBundleWorld(world);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
    problem.priors = BiasedPriors(world, LargeSharedErrors(), &random);
    const std::vector<PosePriorEdge> of_second =
        BiasedPriors(world, second, &random);
    const size_t half = problem.priors.size() / 2;
    for (size_t k = 0; k < problem.priors.size(); ++k) {
      PosePriorEdge& edge = problem.priors[k];
      if (k > half) edge = of_second[k];
      edge.windows.drive = k > half ? 1 : 0;
      edge.cam2_from_cam1.translation /= 1.0 + (k > half ? kScale : -kScale);
    }
    problem.priors.erase(problem.priors.begin() + half);
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.keypoint_sigma_px = world.pixel_noise_px;
    colmap::Reconstruction own = given;
    const SharedErrors found =
        AdjustBundle(options, problem, &own).shared_errors;
    // The tolerance of one drive (above), with half the images.
    EXPECT_NEAR(found.driving_direction.at(0).y(), 0.02, 3e-3);
    EXPECT_NEAR(found.driving_direction.at(1).y(), -0.02, 3e-3);
    // A hundred lengths of 1.5 m +- 0.02 m determine each scale to 0.13 %.
    EXPECT_NEAR(found.length_scale.at(1) - found.length_scale.at(0),
                2.0 * kScale, 6e-3);
    EXPECT_NEAR(found.length_scale.at(1) + found.length_scale.at(0), 0.0, 2e-4);
    for (PosePriorEdge& edge : problem.priors) edge.windows.drive = 0;
    colmap::Reconstruction common = given;
    ASSERT_TRUE(AdjustBundle(options, problem, &common).success);
    EXPECT_LT(AlignedCenterError(world, own),
              0.8 * AlignedCenterError(world, common));
  }
}

// The rates between images change from place to place, which a clock that is
// off adds to the rotations.
TEST(SharedErrorsTest, FindsTheTimeShift) {
  BundleWorldOptions world;
  world.num_images = 100;
  world.num_keypoints_per_image = 100;
  world.pixel_noise_px = 0.3;
  constexpr double kShiftS = 0.006;
  for (const uint64_t seed : {1, 2, 3}) {
    world.seed = seed;
    Random random(seed);
    const colmap::Reconstruction given = BuildBundleWorld(world);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
    SharedErrors none;
    none.gyroscope_bias[0] = none.driving_direction[0] =
        Eigen::Vector3d::Zero();
    problem.priors = BiasedPriors(world, none, &random);
    for (PosePriorEdge& edge : problem.priors) {
      const Eigen::Vector3d rate = random.GaussianVector(0.2);
      edge.windows.rotation_by_time_shift = rate;
      Eigen::Quaterniond& rotation = edge.cam2_from_cam1.rotation;
      rotation = ExpSo3(-kShiftS * rate) * rotation;
    }
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.keypoint_sigma_px = world.pixel_noise_px;
    colmap::Reconstruction model = given;
    const PriorBundleAdjustmentSummary with =
        AdjustBundle(options, problem, &model);
    ASSERT_TRUE(with.success);
    // 297 coordinates of 2e-4 rad at 0.2 rad/s determine it to 0.06 ms, and to
    // 0.08 ms with vision's own errors of the same size.
    EXPECT_NEAR(with.shared_errors.time_shift.at(0), kShiftS, 3e-4);
    options.shared_errors.enabled = false;
    model = given;
    const PriorBundleAdjustmentSummary without =
        AdjustBundle(options, problem, &model);
    ASSERT_TRUE(without.success);
    EXPECT_EQ(without.shared_errors.time_shift.at(0), 0.0);
  }
}

// A camera that turns to both sides by up to 30 deg, about its y axis.
TEST(SharedErrorsTest, FindsTheScalesOfTheGyroscope) {
  BundleWorldOptions world;
  world.num_images = 200;
  world.num_keypoints_per_image = 160;
  world.pixel_noise_px = 0.3;
  world.weave_rad = 0.5;
  SharedErrors none;
  none.gyroscope_bias[0] = none.driving_direction[0] = Eigen::Vector3d::Zero();
  const Eigen::Vector3d too_large(0.01, 0.02, -0.01);
  double sum_with_m = 0.0;
  double sum_without_m = 0.0;
  for (const uint64_t seed : {1, 2, 3}) {
    world.seed = seed;
    const colmap::Reconstruction given = BuildBundleWorld(world);
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.keypoint_sigma_px = world.pixel_noise_px;
    // Returns the error of the centres with rotations from rates that are too
    // large by these shares.
    const auto adjust = [&](const Eigen::Vector3d& shares,
                            SharedErrors* found) {
      Random random(seed);
      PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
      problem.priors = BiasedPriors(world, none, &random);
      for (PosePriorEdge& edge : problem.priors) {
        Eigen::Quaterniond& rotation = edge.cam2_from_cam1.rotation;
        const Eigen::Vector3d angles = LogSo3(rotation);
        rotation = ExpSo3(angles + shares.cwiseProduct(angles));
      }
      colmap::Reconstruction model = given;
      *found = AdjustBundle(options, problem, &model).shared_errors;
      return AlignedCenterError(world, model);
    };
    SharedErrors found;
    const double right_m = adjust(Eigen::Vector3d::Zero(), &found);
    // 199 rotations of 0.042 rad (rms) +- 2e-4 rad determine the scale to
    // 3.4e-4, and to 8e-4 with vision's errors and an unknown bias.
    constexpr double kTolerance = 2.4e-3;
    EXPECT_NEAR(found.gyroscope_scale.at(0).y(), 0.0, kTolerance);
    const double with_m = adjust(too_large, &found);
    EXPECT_LT(with_m, 1.1 * right_m);
    EXPECT_NEAR(found.gyroscope_scale.at(0).y(),
                1.0 / (1.0 + too_large.y()) - 1.0, kTolerance);
    options.shared_errors.enabled = false;
    sum_without_m += adjust(too_large, &found);
    sum_with_m += with_m;
  }
  EXPECT_LT(sum_with_m, 0.8 * sum_without_m);
}

// A bias with next to no random walk is one constant, however many windows it
// has: its prior counts once, not once per window.
TEST(SharedErrorsTest, AConstantBiasIsHeldBackOnce) {
  BundleWorldOptions world;
  world.num_images = 200;
  world.num_keypoints_per_image = 40;
  world.pixel_noise_px = 0.3;
  Random random(1);
  const colmap::Reconstruction given = BuildBundleWorld(world);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
  problem.priors = BiasedPriors(world, LargeSharedErrors(), &random);
  PriorBundleAdjustmentOptions options = ConvergeFully();
  options.keypoint_sigma_px = world.pixel_noise_px;
  options.shared_errors.gyroscope_random_walk_rad_s_sqrt_s = 1e-7;
  const auto bias_of = [&](double window_s) {
    options.shared_errors.gyroscope_window_s = window_s;
    colmap::Reconstruction model = given;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundle(options, problem, &model);
    EXPECT_TRUE(summary.success);
    return summary.shared_errors.gyroscope_bias;
  };
  // One window for the minute that the drive takes.
  const Eigen::Vector3d constant = bias_of(1000.0).at(0);
  EXPECT_GT(constant.norm(), 5e-4);
  const std::map<int, Eigen::Vector3d> walking = bias_of(6.0);
  ASSERT_GE(walking.size(), 9);
  for (const auto& [window, bias] : walking) {
    EXPECT_LT((bias - constant).norm(), 0.02 * constant.norm()) << window;
  }
}

// A gyroscope that warms up: about the y axis, about which the camera turns.
TEST(SharedErrorsTest, FollowsABiasThatDrifts) {
  BundleWorldOptions world;
  world.num_images = 200;
  world.num_keypoints_per_image = 100;
  world.pixel_noise_px = 0.3;
  constexpr double kDrift = 3e-3;  // rad/s, from the first image to the last
  SharedErrors none;
  none.gyroscope_bias[0] = none.driving_direction[0] = Eigen::Vector3d::Zero();
  double sum_m = 0.0, sum_without_drift_m = 0.0, sum_of_constant_m = 0.0;
  for (const uint64_t seed : {1, 2, 3}) {
    world.seed = seed;
    const colmap::Reconstruction given = BuildBundleWorld(world);
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.keypoint_sigma_px = world.pixel_noise_px;
    const auto adjust = [&](double drift) {
      Random random(seed);
      PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
      problem.priors = BiasedPriors(world, none, &random);
      for (size_t k = 0; k < problem.priors.size(); ++k) {
        PosePriorEdge& edge = problem.priors[k];
        const double bias = drift * k / problem.priors.size();
        Eigen::Quaterniond& rotation = edge.cam2_from_cam1.rotation;
        rotation =
            ExpSo3(-bias * edge.dt_s * Eigen::Vector3d::UnitY()) * rotation;
      }
      colmap::Reconstruction model = given;
      EXPECT_TRUE(AdjustBundle(options, problem, &model).success);
      return AlignedCenterError(world, model);
    };
    sum_m += adjust(kDrift);
    sum_without_drift_m += adjust(0.0);
    options.shared_errors.gyroscope_random_walk_rad_s_sqrt_s = 1e-7;
    sum_of_constant_m += adjust(kDrift);
  }
  EXPECT_LT(sum_m, 1.2 * sum_without_drift_m);
  EXPECT_LT(sum_m, 0.7 * sum_of_constant_m);
}

// Directions of driving with errors that are smooth in time, as after a
// smoother: each error has the stated sigma, but neighbours do not average out.
std::vector<PosePriorEdge> DriftingPriors(const BundleWorldOptions& options,
                                          Random* random) {
  constexpr double kDt = 0.3;
  constexpr double kSigma = 4e-3;
  const double decay = std::exp(-kDt / 10.0);
  Eigen::Vector3d drift = random->GaussianVector(kSigma);
  std::vector<PosePriorEdge> edges = TruePriors(options);
  for (PosePriorEdge& edge : edges) {
    edge.dt_s = kDt;
    edge.rotation_sigma_rad = 2e-4;
    edge.direction_sigma_rad = kSigma;
    edge.length_sigma_m = 0.02;
    Rigid3d& motion = edge.cam2_from_cam1;
    motion.rotation = (ExpSo3(random->GaussianVector(edge.rotation_sigma_rad)) *
                       motion.rotation)
                          .normalized();
    motion.translation = ExpSo3(drift) * motion.translation;
    drift = decay * drift +
            random->GaussianVector(kSigma * std::sqrt(1.0 - decay * decay));
  }
  return edges;
}

// The errors of the centres with the first and with the second options, summed
// over six worlds.
std::pair<double, double> CompareErrors(
    const std::function<std::vector<PosePriorEdge>(const BundleWorldOptions&,
                                                   Random*)>& make_priors,
    const SharedErrorOptions& first, const SharedErrorOptions& second) {
  BundleWorldOptions world;
  world.num_images = 200;
  world.num_keypoints_per_image = 150;
  world.pixel_noise_px = 0.3;
  std::pair<double, double> errors_m;
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    world.seed = seed;
    Random random(seed);
    const colmap::Reconstruction given = BuildBundleWorld(world);
    PriorBundleAdjustmentProblem problem = ProblemOfAll(given);
    problem.priors = make_priors(world, &random);
    PriorBundleAdjustmentOptions options = ConvergeFully();
    options.keypoint_sigma_px = world.pixel_noise_px;
    const auto error_m = [&](const SharedErrorOptions& shared_errors) {
      options.shared_errors = shared_errors;
      colmap::Reconstruction adjusted = given;
      EXPECT_TRUE(AdjustBundle(options, problem, &adjusted).success);
      return AlignedCenterError(world, adjusted);
    };
    errors_m.first += error_m(first);
    errors_m.second += error_m(second);
  }
  return errors_m;
}

TEST(SharedErrorsTest, DirectionsThatErrTogetherDoNotOutvoteVision) {
  SharedErrorOptions without;
  without.direction_drift_time_s = 0.0;
  const auto [with_m, without_m] =
      CompareErrors(DriftingPriors, SharedErrorOptions(), without);
  EXPECT_LT(with_m, 0.8 * without_m);
}

// Wheels on gravel: the relative length errors of consecutive motions are
// correlated, with a time constant of 3 s.
std::vector<PosePriorEdge> LengthDriftPriors(const BundleWorldOptions& options,
                                             double sigma_ratio,
                                             Random* random) {
  constexpr double kDt = 0.3;
  constexpr double kSigma = 0.01;
  const double decay = std::exp(-kDt / 3.0);
  double drift = random->Gaussian(sigma_ratio);
  std::vector<PosePriorEdge> edges = TruePriors(options);
  for (PosePriorEdge& edge : edges) {
    edge.dt_s = kDt;
    edge.rotation_sigma_rad = 2e-4;
    edge.direction_sigma_rad = kSigma;
    Rigid3d& motion = edge.cam2_from_cam1;
    edge.length_sigma_m = 0.01 * motion.translation.norm();
    motion.rotation = (ExpSo3(random->GaussianVector(edge.rotation_sigma_rad)) *
                       motion.rotation)
                          .normalized();
    motion.translation *= 1.0 + drift;
    drift = decay * drift +
            random->Gaussian(sigma_ratio * std::sqrt(1.0 - decay * decay));
  }
  return edges;
}

TEST(SharedErrorsTest, LengthsThatErrTogetherDoNotOutvoteVision) {
  constexpr double kRatio = 0.02;
  const auto priors = [](const BundleWorldOptions& world, Random* random) {
    return LengthDriftPriors(world, kRatio, random);
  };
  SharedErrorOptions with;
  with.length_drift_ratio = kRatio;
  const auto [with_m, without_m] =
      CompareErrors(priors, with, SharedErrorOptions());
  EXPECT_LT(with_m, 0.8 * without_m);
}

}  // namespace
}  // namespace adasfm
