// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/reduced_system.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "colmap_ext/bundle_adjustment/bundle_reducer.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

// Lists the parameters that are not constant: those of the reduced system in
// the order of its columns, then the points in the order of their first
// residuals.
std::vector<double*> ListParameters(BundleProblem* bundle) {
  ceres::Problem& problem = *bundle->CeresProblem();
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<double*> listed, points;
  for (AdjustedPose& pose : bundle->Poses()) {
    if (problem.HasParameterBlock(pose.parameters) &&
        !problem.IsParameterBlockConstant(pose.parameters)) {
      listed.push_back(pose.parameters);
    }
  }
  for (const ceres::ResidualBlockId id : ids) {
    std::vector<double*> blocks;
    problem.GetParameterBlocksForResidualBlock(id, &blocks);
    for (double* block : blocks) {
      std::vector<double*>& list = bundle->IsPoint(block) ? points : listed;
      if (!problem.IsParameterBlockConstant(block) &&
          std::find(list.begin(), list.end(), block) == list.end()) {
        list.push_back(block);
      }
    }
  }
  std::vector<double*> ordered = BundleReducer(bundle, 1).Parameters();
  EXPECT_TRUE(std::is_permutation(listed.begin(), listed.end(), ordered.begin(),
                                  ordered.end()));
  ordered.insert(ordered.end(), points.begin(), points.end());
  return ordered;
}

// The step and the covariance of all parameters but the points, from the whole
// Jacobian.
struct DenseSolution {
  Eigen::VectorXd step;
  Eigen::MatrixXd covariance;
};

DenseSolution SolveDensely(BundleProblem* bundle, int size) {
  ceres::Problem& problem = *bundle->CeresProblem();
  ceres::Problem::EvaluateOptions options;
  options.apply_loss_function = false;
  options.parameter_blocks = ListParameters(bundle);
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  problem.Evaluate(options, nullptr, &residuals, nullptr, &jacobian);
  Eigen::MatrixXd dense =
      Eigen::MatrixXd::Zero(jacobian.num_rows, jacobian.num_cols);
  for (int row = 0; row < jacobian.num_rows; ++row) {
    for (int k = jacobian.rows[row]; k < jacobian.rows[row + 1]; ++k) {
      dense(row, jacobian.cols[k]) = jacobian.values[k];
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> information(dense.transpose() * dense);
  const Eigen::Map<const Eigen::VectorXd> residual(residuals.data(),
                                                   residuals.size());
  const Eigen::VectorXd gradient = dense.transpose() * residual;
  const Eigen::VectorXd step = information.solve(-gradient);
  const Eigen::MatrixXd columns = information.solve(
      Eigen::MatrixXd::Identity(dense.cols(), dense.cols()).leftCols(size));
  return {step.head(size), columns.topRows(size)};
}

// All images, with priors that share errors.
PriorBundleAdjustmentProblem ProblemWithPriors(
    const BundleWorldOptions& world, const colmap::Reconstruction& model) {
  PriorBundleAdjustmentProblem problem = ProblemOfAll(model);
  problem.priors = TruePriors(world);
  for (size_t k = 0; k < problem.priors.size(); ++k) {
    problem.priors[k].dt_s = 0.3;
    problem.priors[k].windows = {static_cast<int>(k / 4),
                                 static_cast<int>(k / 2)};
  }
  return problem;
}

BundleWorldOptions SmallWorld() {
  BundleWorldOptions world;
  world.num_images = 8;
  world.num_keypoints_per_image = 30;
  return world;
}

TEST(ReducedSystem, HasTheStepAndTheCovarianceOfTheWholeAdjustment) {
  const BundleWorldOptions world = SmallWorld();
  const colmap::Reconstruction model = BuildBundleWorld(world);
  const PriorBundleAdjustmentProblem problem = ProblemWithPriors(world, model);
  for (const bool refines_focal_length : {false, true}) {
    PriorBundleAdjustmentOptions options;
    options.reproj_loss_scale_px = 0.0;
    options.refine_focal_length = refines_focal_length;
    BundleProblem bundle(options, problem, model);
    bundle.FixFirstPose();
    const std::unique_ptr<ReducedSystem> reduced_system =
        BuildReducedSystem(&bundle);
    const ReducedSystem& system = *reduced_system;
    Eigen::MatrixXd information =
        Eigen::MatrixXd(system.rest).selfadjointView<Eigen::Lower>();
    Eigen::VectorXd gradient = system.rest_gradient;
    ASSERT_EQ(system.priors.size(), 3 * problem.priors.size());
    for (const ReducedPriorRows& rows : system.priors) {
      Eigen::MatrixXd jacobian =
          Eigen::MatrixXd::Zero(rows.residuals.size(), gradient.size());
      for (size_t k = 0; k < rows.columns.size(); ++k) {
        jacobian.col(rows.columns[k]) = rows.jacobian.col(k);
      }
      information += jacobian.transpose() * jacobian;
      gradient += jacobian.transpose() * rows.residuals;
    }
    const DenseSolution dense = SolveDensely(&bundle, gradient.size());
    const Eigen::LDLT<Eigen::MatrixXd> reduced(information);
    EXPECT_LT((reduced.solve(-gradient) - dense.step).norm(),
              1e-6 * dense.step.norm());
    const Eigen::MatrixXd covariance = reduced.solve(
        Eigen::MatrixXd::Identity(gradient.size(), gradient.size()));
    EXPECT_LT((covariance - dense.covariance).norm(),
              1e-6 * dense.covariance.norm());
  }
}

TEST(ReducedSystem, IsTheSameWhenPointsAreKeptApart) {
  BundleWorldOptions world = SmallWorld();
  world.pixel_noise_px = 0.5;
  colmap::Reconstruction model = BuildBundleWorld(world);
  PerturbBundleWorld(2e-3, 0.05, 1, &model);
  PriorBundleAdjustmentProblem problem = ProblemWithPriors(world, model);
  problem.images.erase(3);
  problem.constant_images = {3};
  std::vector<std::unique_ptr<ReducedSystem>> systems;
  for (const bool points_apart : {false, true}) {
    BundleProblem bundle(PriorBundleAdjustmentOptions(), problem, model,
                         points_apart);
    EXPECT_EQ(bundle.NumPointsApart() > 0, points_apart);
    systems.push_back(BuildReducedSystem(&bundle));
  }
  const Eigen::MatrixXd listed = systems[0]->rest;
  const Eigen::MatrixXd apart = systems[1]->rest;
  ASSERT_EQ(apart.rows(), listed.rows());
  EXPECT_LT((apart - listed).norm(), 1e-12 * listed.norm());
  EXPECT_LT((systems[1]->rest_gradient - systems[0]->rest_gradient).norm(),
            1e-11 * systems[0]->rest_gradient.norm());
  ASSERT_EQ(systems[1]->priors.size(), systems[0]->priors.size());
  for (size_t k = 0; k < systems[0]->priors.size(); ++k) {
    EXPECT_EQ(systems[1]->priors[k].columns, systems[0]->priors[k].columns);
  }
}

}  // namespace
}  // namespace adasfm
