// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/pose_prior_cost.h"

#include <gtest/gtest.h>

#include <functional>

#include "colmap_ext/cost_functions/reprojection_cost.h"
#include "core/random.h"

namespace adasfm {
namespace {

AdjustedPose RandomPose(Random* random) {
  AdjustedPose pose(Rigid3d(ExpSo3(random->GaussianVector(1.0)),
                            random->GaussianVector(2.0)));
  for (double& parameter : pose.parameters) {
    parameter = random->Gaussian(0.3);
  }
  pose.Update();
  return pose;
}

// The largest difference between a cost's Jacobian for one block of `size`
// parameters and central differences; `changed` runs after each change.
double JacobianError(const ceres::CostFunction& cost,
                     const std::vector<double*>& parameters, int block,
                     const std::function<void()>& changed) {
  const int num_residuals = cost.num_residuals();
  const int size = cost.parameter_block_sizes()[block];
  std::vector<double> jacobian(num_residuals * size);
  std::vector<double*> jacobians(parameters.size(), nullptr);
  jacobians[block] = jacobian.data();
  std::vector<double> residuals(num_residuals);
  cost.Evaluate(parameters.data(), residuals.data(), jacobians.data());
  double max_error = 0.0;
  constexpr double kStep = 1e-6;
  for (int col = 0; col < size; ++col) {
    double& parameter = parameters[block][col];
    const double value = parameter;
    std::vector<double> plus(num_residuals), minus(num_residuals);
    parameter = value + kStep;
    changed();
    cost.Evaluate(parameters.data(), plus.data(), nullptr);
    parameter = value - kStep;
    changed();
    cost.Evaluate(parameters.data(), minus.data(), nullptr);
    parameter = value;
    changed();
    for (int row = 0; row < num_residuals; ++row) {
      const double numeric = (plus[row] - minus[row]) / (2.0 * kStep);
      max_error =
          std::max(max_error, std::abs(numeric - jacobian[row * size + col]) /
                                  std::max(1.0, std::abs(numeric)));
    }
  }
  return max_error;
}

PosePriorEdge RandomEdge(Random* random) {
  PosePriorEdge edge;
  edge.image_id1 = 1;
  edge.image_id2 = 2;
  edge.cam2_from_cam1 =
      Rigid3d(ExpSo3(random->GaussianVector(1.0)), random->GaussianVector(2.0));
  edge.rotation_sigma_rad = 0.5;
  edge.direction_sigma_rad = 0.7;
  edge.length_sigma_m = 2.0;
  edge.translation_sigma_m = 3.0;
  return edge;
}

class PosePriorCostTest : public testing::TestWithParam<PosePriorCost::Term> {};

TEST_P(PosePriorCostTest, JacobiansEqualNumericOnes) {
  for (int seed = 0; seed < 20; ++seed) {
    Random random(seed);
    AdjustedPose pose1 = RandomPose(&random);
    AdjustedPose pose2 = RandomPose(&random);
    const PosePriorCost cost(RandomEdge(&random), GetParam(), 1.0, &pose1,
                             &pose2);
    const auto changed = [&] {
      pose1.Update();
      pose2.Update();
    };
    for (const int block : {0, 1}) {
      EXPECT_LT(JacobianError(cost, {pose1.parameters, pose2.parameters}, block,
                              changed),
                1e-5)
          << "seed " << seed << ", pose " << block + 1;
    }
  }
}

TEST_P(PosePriorCostTest, IsZeroAtTheMeasurement) {
  for (int seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const AdjustedPose pose1 = RandomPose(&random);
    const AdjustedPose pose2 = RandomPose(&random);
    PosePriorEdge edge = RandomEdge(&random);
    edge.cam2_from_cam1 =
        ComputeCam2FromCam1(pose1.CamFromWorld(), pose2.CamFromWorld());
    const PosePriorCost cost(edge, GetParam(), 1.0, &pose1, &pose2);
    const double* parameters[] = {pose1.parameters, pose2.parameters};
    std::vector<double> residuals(cost.num_residuals());
    cost.Evaluate(parameters, residuals.data(), nullptr);
    for (const double residual : residuals) EXPECT_NEAR(residual, 0.0, 1e-9);
  }
}

TEST_P(PosePriorCostTest, JacobiansBySharedErrorsEqualNumericOnes) {
  for (int seed = 0; seed < 20; ++seed) {
    Random random(seed);
    AdjustedPose pose1 = RandomPose(&random);
    AdjustedPose pose2 = RandomPose(&random);
    PosePriorEdge edge = RandomEdge(&random);
    edge.dt_s = 0.3;
    edge.windows.length_per_direction = 0.5 * (seed % 3);
    edge.windows.has_length_scale = seed % 2 == 1;
    if (seed % 2 == 1) {
      edge.windows.rotation_by_time_shift = random.GaussianVector(0.3);
    }
    const PosePriorCost cost(edge, GetParam(), 1.0, &pose1, &pose2);
    std::vector<Eigen::Vector3d> shared(cost.parameter_block_sizes().size() -
                                        2);
    std::vector<double*> parameters = {pose1.parameters, pose2.parameters};
    for (Eigen::Vector3d& values : shared) {
      values = random.GaussianVector(0.1);
      parameters.push_back(values.data());
    }
    const auto changed = [&] {
      pose1.Update();
      pose2.Update();
    };
    for (size_t block = 0; block < parameters.size(); ++block) {
      EXPECT_LT(JacobianError(cost, parameters, block, changed), 1e-5)
          << "seed " << seed << ", block " << block;
    }
  }
}

// To first order, the residuals of a prior with known shared errors vanish at
// the motion that SharedErrors::Correct returns.
TEST_P(PosePriorCostTest, SharedErrorsAreThoseThatCorrectTakesOut) {
  for (int seed = 0; seed < 20; ++seed) {
    Random random(seed);
    PosePriorEdge edge = RandomEdge(&random);
    edge.dt_s = 0.3;
    edge.windows.length_per_direction = 0.5 * (seed % 3);
    edge.windows.has_length_scale = seed % 2 == 1;
    if (seed % 2 == 1) {
      edge.windows.rotation_by_time_shift = random.GaussianVector(0.3);
    }
    SharedErrors errors;
    if (seed % 2 == 1) {
      errors.length_scale[0] = random.Gaussian(1e-3);
      errors.time_shift[0] = random.Gaussian(5e-3);
    }
    errors.gyroscope_bias[0] = random.GaussianVector(1e-3);
    errors.extrinsic_rotation[0] = random.GaussianVector(1e-3);
    errors.gyroscope_scale[0] = random.GaussianVector(1e-3);
    errors.driving_direction[0] = random.GaussianVector(1e-3);
    errors.direction_drift[0] = random.GaussianVector(1e-3);
    AdjustedPose pose1 = RandomPose(&random);
    AdjustedPose pose2(
        errors.Correct(edge.cam2_from_cam1, edge.dt_s, edge.windows) *
        pose1.CamFromWorld());
    const PosePriorCost cost(edge, GetParam(), 1.0, &pose1, &pose2);
    const bool is_rotation = GetParam() == PosePriorCost::Term::kRotation;
    const bool is_length = GetParam() == PosePriorCost::Term::kLength;
    std::vector<const double*> parameters = {pose1.parameters,
                                             pose2.parameters};
    if (is_rotation) {
      parameters.push_back(errors.extrinsic_rotation.at(0).data());
      parameters.push_back(errors.gyroscope_bias.at(0).data());
      parameters.push_back(errors.gyroscope_scale.at(0).data());
      if (parameters.size() < cost.parameter_block_sizes().size()) {
        parameters.push_back(&errors.time_shift.at(0));
      }
    } else {
      if (!is_length) {
        parameters.push_back(errors.driving_direction.at(0).data());
      }
      if (!is_length || edge.windows.length_per_direction > 0.0) {
        parameters.push_back(errors.direction_drift.at(0).data());
      }
      if (parameters.size() < cost.parameter_block_sizes().size()) {
        parameters.push_back(&errors.length_scale.at(0));
      }
    }
    ASSERT_EQ(parameters.size(), cost.parameter_block_sizes().size());
    std::vector<double> residuals(cost.num_residuals());
    cost.Evaluate(parameters.data(), residuals.data(), nullptr);
    // Second-order terms of errors of 1e-3.
    for (const double residual : residuals) EXPECT_NEAR(residual, 0.0, 3e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(Terms, PosePriorCostTest,
                         testing::Values(PosePriorCost::Term::kRotation,
                                         PosePriorCost::Term::kDirection,
                                         PosePriorCost::Term::kLength,
                                         PosePriorCost::Term::kTranslation));

TEST(DirectionErrorTest, NormIsTheAngle) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d reference = random.UnitVector();
    const Eigen::Vector3d vector = random.GaussianVector(3.0);
    Eigen::Matrix<double, 3, 2> basis;
    basis.col(0) = reference.unitOrthogonal();
    basis.col(1) = reference.cross(basis.col(0));
    const Eigen::Vector2d error =
        DirectionError(vector, reference, basis, nullptr);
    // Within 0.02 rad of the opposite direction the error is set to pi.
    EXPECT_NEAR(error.norm(), AngleBetweenRad(vector, reference), 0.021);
    if (error.norm() < 3.0) {
      EXPECT_NEAR(error.norm(), AngleBetweenRad(vector, reference), 1e-9);
    }
  }
}

TEST(DirectionErrorTest, IsFiniteWhereThereIsNoDirection) {
  const Eigen::Vector3d reference = Eigen::Vector3d::UnitZ();
  const Eigen::Matrix<double, 3, 2> basis =
      Eigen::Matrix3d::Identity().leftCols<2>();
  for (const Eigen::Vector3d& vector :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, -1),
        Eigen::Vector3d(1e-9, 0, -1), Eigen::Vector3d(0, 0, 1)}) {
    Eigen::Matrix<double, 2, 3> jacobian;
    EXPECT_TRUE(
        DirectionError(vector, reference, basis, &jacobian).allFinite());
    EXPECT_TRUE(jacobian.allFinite());
  }
}

TEST(ReprojectionCostTest, JacobiansEqualNumericOnes) {
  for (int seed = 0; seed < 20; ++seed) {
    Random random(seed);
    AdjustedPose pose = RandomPose(&random);
    Eigen::Vector3d point =
        pose.CamFromWorld().Inverse() *
        Eigen::Vector3d(random.Gaussian(1.0), random.Gaussian(1.0),
                        random.Uniform(1.0, 5.0));
    NormalizedKeypoint keypoint;
    keypoint.normalized = Eigen::Vector2d(0.1, -0.2);
    keypoint.whitened_from_normalized << 2.0, 0.3, -0.4, 1.5;
    const ReprojectionCost cost(keypoint, &pose);
    for (const int block : {0, 1}) {
      EXPECT_LT(JacobianError(cost, {pose.parameters, point.data()}, block,
                              [&] { pose.Update(); }),
                1e-5)
          << "seed " << seed << ", block " << block;
    }
  }
}

TEST(ReprojectionCostTest, IsConstantBehindTheCamera) {
  const AdjustedPose pose;
  const ReprojectionCost cost(NormalizedKeypoint(), &pose);
  for (const double depth : {-1.0, 0.0}) {
    const Eigen::Vector3d point(0.1, 0.1, depth);
    const double* parameters[] = {pose.parameters, point.data()};
    double residuals[2], from_pose[12], from_point[6];
    double* jacobians[] = {from_pose, from_point};
    ASSERT_TRUE(cost.Evaluate(parameters, residuals, jacobians));
    EXPECT_EQ(residuals[0], kBehindCameraResidual);
    for (const double value : from_pose) EXPECT_EQ(value, 0.0);
    for (const double value : from_point) EXPECT_EQ(value, 0.0);
  }
}

}  // namespace
}  // namespace adasfm
