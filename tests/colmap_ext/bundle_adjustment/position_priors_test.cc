// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/position_priors.h"

#include <gtest/gtest.h>

#include "colmap_ext/host/pose_conversion.h"
#include "core/sim3d.h"
#include "tests/testing/colmap_ext/bundle_world.h"

namespace adasfm {
namespace {

AdjustedPose RandomPose(Random* random) {
  AdjustedPose pose(Rigid3d(ExpSo3(random->GaussianVector(1.0)),
                            random->GaussianVector(2.0)));
  for (double& parameter : pose.parameters) parameter = random->Gaussian(0.3);
  pose.Update();
  return pose;
}

// The largest difference of a cost's Jacobians from central differences.
double JacobianError(const ceres::CostFunction& cost,
                     const std::vector<AdjustedPose*>& poses) {
  std::vector<double*> parameters;
  for (AdjustedPose* pose : poses) parameters.push_back(pose->parameters);
  std::vector<std::vector<double>> storage(poses.size(),
                                           std::vector<double>(18));
  std::vector<double*> jacobians;
  for (std::vector<double>& values : storage)
    jacobians.push_back(values.data());
  double residuals[3];
  cost.Evaluate(parameters.data(), residuals, jacobians.data());
  double max_error = 0.0;
  constexpr double kStep = 1e-6;
  for (size_t block = 0; block < poses.size(); ++block) {
    for (int col = 0; col < 6; ++col) {
      double both[2][3];
      for (const int side : {0, 1}) {
        const double change = side == 0 ? kStep : -kStep;
        poses[block]->parameters[col] += change;
        poses[block]->Update();
        cost.Evaluate(parameters.data(), both[side], nullptr);
        poses[block]->parameters[col] -= change;
        poses[block]->Update();
      }
      for (int row = 0; row < 3; ++row) {
        const double numeric = (both[0][row] - both[1][row]) / (2.0 * kStep);
        max_error = std::max(max_error,
                             std::abs(numeric - storage[block][6 * row + col]) /
                                 std::max(1.0, std::abs(numeric)));
      }
    }
  }
  return max_error;
}

TEST(PositionPriors, JacobiansMatchNumericDifferences) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    AdjustedPose pose1 = RandomPose(&random), pose2 = RandomPose(&random);
    PositionPrior prior;
    prior.share = random.Uniform(0.0, 1.0);
    prior.position = random.GaussianVector(5.0);
    prior.antenna_in_cam = random.GaussianVector(1.0);
    const Eigen::Matrix3d root = Eigen::Matrix3d::NullaryExpr(
        [&random]() { return random.Gaussian(1.0); });
    prior.covariance =
        root * root.transpose() + 0.1 * Eigen::Matrix3d::Identity();
    EXPECT_LT(
        JacobianError(PositionCost(prior, &pose1, &pose2), {&pose1, &pose2}),
        1e-6);
    EXPECT_LT(JacobianError(PositionCost(prior, &pose1, &pose1), {&pose1}),
              1e-6);
    EXPECT_LT(
        JacobianError(VerticalCost(random.UnitVector(), 0.1, &pose1), {&pose1}),
        1e-6);
  }
}

// The squared residual norm is the squared Mahalanobis distance, for a
// covariance of any shape.
TEST(PositionPriors, WhitensWithTheCovariance) {
  Random random(4);
  AdjustedPose pose(Rigid3d{});
  PositionPrior prior;
  prior.covariance << 4.0, 1.0, 0.0, 1.0, 2.0, 0.5, 0.0, 0.5, 1.0;
  prior.position = random.GaussianVector(2.0);
  double residuals[3];
  const double* parameters[] = {pose.parameters};
  PositionCost(prior, &pose, &pose).Evaluate(parameters, residuals, nullptr);
  EXPECT_NEAR(
      Eigen::Vector3d(residuals[0], residuals[1], residuals[2]).squaredNorm(),
      prior.position.dot(prior.covariance.inverse() * prior.position), 1e-9);
}

// A model of a street under a wrong similarity, with a position at every image.
struct PositionedWorld {
  BundleWorldOptions options;
  colmap::Reconstruction reconstruction;
  PriorBundleAdjustmentProblem problem;
};

PositionedWorld MakeWorld(double sigma_m, uint64_t seed) {
  PositionedWorld world;
  world.options.num_images = 40;
  world.options.pixel_noise_px = 0.5;
  world.options.seed = seed;
  world.reconstruction = BuildBundleWorld(world.options);
  Random random(seed + 100);
  const Eigen::Vector3d antenna(0.2, -1.0, -0.5);
  for (int i = 0; i < world.options.num_images; ++i) {
    const Rigid3d pose = BundleWorldPose(world.options, i);
    world.problem.images.insert(i + 1);
    PositionPrior prior;
    prior.image_id1 = prior.image_id2 = i + 1;
    prior.antenna_in_cam = antenna;
    prior.position = pose.TargetOriginInSource() +
                     pose.rotation.conjugate() * antenna +
                     random.GaussianVector(sigma_m);
    prior.covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
    world.problem.positions.push_back(prior);
    world.problem.gravity_in_cam[i + 1] =
        pose.rotation * -Eigen::Vector3d::UnitZ();
  }
  world.problem.gravity_sigma_rad = 0.01;
  // A metre away, rotated by 1 deg, and 2 % too long.
  const Sim3d wrong(1.02, ExpSo3(Eigen::Vector3d(0.0, 0.0, DegToRad(1.0))),
                    Eigen::Vector3d(0.6, -0.7, 0.4));
  for (const image_t id : world.reconstruction.RegImageIds()) {
    colmap::Image& image = world.reconstruction.Image(id);
    SetCamFromWorld(TransformCamFromWorld(wrong, CamFromWorld(image)), &image);
  }
  for (const colmap::point3D_t id : world.reconstruction.Point3DIds()) {
    colmap::Point3D& point = world.reconstruction.Point3D(id);
    point.SetXYZ(wrong * point.XYZ());
  }
  return world;
}

double RmsError(const PositionedWorld& world) {
  double sum = 0.0;
  for (int i = 0; i < world.options.num_images; ++i) {
    sum += (CamFromWorld(world.reconstruction.Image(i + 1))
                .TargetOriginInSource() -
            BundleWorldPose(world.options, i).TargetOriginInSource())
               .squaredNorm();
  }
  return std::sqrt(sum / world.options.num_images);
}

// 40 positions of 0.3 m determine the seven degrees of freedom of the frame:
// the mean squared error is 0.3^2 * 7 / 40 / 3 per direction, 0.13 m RMS in
// space.
TEST(PositionPriors, AdjustmentMovesTheModelOntoThem) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    PositionedWorld world = MakeWorld(0.3, seed);
    EXPECT_GT(RmsError(world), 1.0);
    PriorBundleAdjustmentOptions options;
    const auto summary =
        AdjustBundle(options, world.problem, &world.reconstruction);
    ASSERT_TRUE(summary.success) << summary.message;
    EXPECT_LT(RmsError(world), 0.3);
  }
}

TEST(PositionPriors, AJumpOfAFewIsLeftOut) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    PositionedWorld world = MakeWorld(0.3, seed);
    for (int i = 20; i < 24; ++i) {
      world.problem.positions[i].position.y() += 15.0;
    }
    PositionedWorld trusting = world;
    PriorBundleAdjustmentOptions options;
    AdjustBundle(options, world.problem, &world.reconstruction);
    EXPECT_LT(RmsError(world), 0.35) << seed;
    options.position_loss_scale = 1e6;
    AdjustBundle(options, trusting.problem, &trusting.reconstruction);
    EXPECT_GT(RmsError(trusting), 1.0) << seed;
  }
}

// Too few positions are ignored.
TEST(PositionPriors, TwoPositionsDoNotHoldAFrame) {
  PositionedWorld world = MakeWorld(0.3, 1);
  PositionedWorld without = world;
  world.problem.positions.resize(2);
  without.problem.positions.clear();
  AdjustBundle({}, world.problem, &world.reconstruction);
  AdjustBundle({}, without.problem, &without.reconstruction);
  EXPECT_EQ(RmsError(world), RmsError(without));
}

}  // namespace
}  // namespace adasfm
