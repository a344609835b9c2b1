// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/minimize_point.h"

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <vector>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kFocalLengthPx = 500.0;

// A point 20 m ahead and a little to the side of cameras that approach it by a
// metre each, and its keypoints with a noise of half a pixel.
struct SeenPoint {
  explicit SeenPoint(uint64_t seed, int num_contradictions = 0) {
    constexpr int kNumImages = 8;
    Random random(seed);
    truth = Eigen::Vector3d(random.Uniform(2.0, 6.0), random.Uniform(-2.0, 2.0),
                            20.0);
    for (int i = 0; i < kNumImages; ++i) {
      poses.emplace_back(CamFromWorldWithCenter(
          ExpSo3(random.GaussianVector(0.05)),
          Eigen::Vector3d(0.0, 0.0, i) + random.GaussianVector(0.2)));
    }
    for (int i = 0; i < kNumImages; ++i) {
      PointObservation observation;
      observation.pose = &poses[i];
      const Eigen::Vector3d in_cam =
          poses[i].rotation * (truth - poses[i].center);
      Eigen::Vector2d error_px = random.GaussianVector(0.5).head<2>();
      // Keypoints of another point, all shifted by the same 15 px.
      if (i < num_contradictions) error_px.x() += 15.0;
      observation.keypoint.normalized =
          in_cam.hnormalized() + error_px / kFocalLengthPx;
      observation.keypoint.whitened_from_normalized =
          2.0 * kFocalLengthPx * Eigen::Matrix2d::Identity();
      observations.push_back(observation);
    }
  }

  BundleProblem::ObservationRange Observations() const {
    return {observations.data(), observations.data() + observations.size()};
  }

  double Cost(const ceres::LossFunction* loss, Eigen::Vector3d point) const {
    MinimizePointOptions options;
    options.max_num_iterations = 0;
    return MinimizePoint(options, Observations(), loss, &point);
  }

  Eigen::Vector3d truth;
  std::vector<AdjustedPose> poses;
  std::vector<PointObservation> observations;
};

double SolveWithCeres(const SeenPoint& seen, ceres::LossFunction* loss,
                      Eigen::Vector3d* point) {
  ceres::Problem::Options owns;
  owns.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(owns);
  for (const PointObservation& observation : seen.observations) {
    double* pose = const_cast<double*>(observation.pose->parameters);
    problem.AddResidualBlock(
        new ReprojectionCost(observation.keypoint, observation.pose), loss,
        pose, point->data());
    problem.SetParameterBlockConstant(pose);
  }
  ceres::Solver::Options solver;
  solver.max_num_iterations = 1000;
  solver.function_tolerance = solver.parameter_tolerance = 1e-15;
  solver.gradient_tolerance = 1e-15;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  return summary.final_cost;
}

TEST(MinimizePointTest, FindsTheMinimumOfCeres) {
  ceres::CauchyLoss cauchy(4.0);
  MinimizePointOptions options;
  options.function_tolerance = 1e-12;
  for (ceres::LossFunction* loss :
       {static_cast<ceres::LossFunction*>(nullptr),
        static_cast<ceres::LossFunction*>(&cauchy)}) {
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(seed);
      const SeenPoint seen(seed);
      Random random(100 + seed);
      const Eigen::Vector3d start = seen.truth + random.GaussianVector(0.3);
      Eigen::Vector3d expected = start;
      const double expected_cost = SolveWithCeres(seen, loss, &expected);
      Eigen::Vector3d point = start;
      const double cost =
          MinimizePoint(options, seen.Observations(), loss, &point);
      EXPECT_NEAR(cost, expected_cost, 1e-9 * expected_cost);
      EXPECT_NEAR(cost, seen.Cost(loss, point), 1e-12 * cost);
      // A hundredth of these points' RMS error, 0.16 m.
      EXPECT_LT((point - expected).norm(), 1e-3);
    }
  }
}

// If the observations are of two points, the steps are short, but lead to a
// minimum: no place nearby has a lower cost.
TEST(MinimizePointTest, EndsAtAMinimumOfContradictingObservations) {
  ceres::CauchyLoss cauchy(4.0);
  MinimizePointOptions options;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-10;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    const SeenPoint seen(seed, /*num_contradictions=*/3);
    Eigen::Vector3d point = seen.truth;
    const double start_cost = seen.Cost(&cauchy, point);
    const double cost =
        MinimizePoint(options, seen.Observations(), &cauchy, &point);
    EXPECT_LT(cost, start_cost);
    Random random(seed);
    for (int k = 0; k < 100; ++k) {
      EXPECT_GT(seen.Cost(&cauchy, point + 1e-2 * random.UnitVector()),
                cost * (1.0 - 1e-8));
    }
  }
}

// The keypoint and the inverse depth in a camera that looks at the point change
// linearly, and the point remains in front of it.
TEST(MoveByInverseDistanceTest, IsLinearInKeypointAndInverseDepth) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const double depth = random.Uniform(1.0, 100.0);
    const Eigen::Vector3d point(0.0, 0.0, depth);
    const Eigen::Quaterniond turn = ExpSo3(random.GaussianVector(1.0));
    for (const double size : {1e-3, 0.1, 0.8}) {
      const Eigen::Vector3d step = depth * size * random.UnitVector();
      const Eigen::Vector3d moved =
          turn.inverse() * MoveByInverseDistance(turn * point, turn * step);
      const Eigen::Vector2d keypoint = moved.head<2>() / moved.z();
      EXPECT_LT((keypoint - step.head<2>() / depth).norm(), 1e-12);
      EXPECT_NEAR(depth / moved.z(), 1.0 - step.z() / depth, 1e-12);
    }
    const Eigen::Vector3d step = random.UnitVector();
    EXPECT_EQ(MoveByInverseDistance(Eigen::Vector3d::Zero(), step), step);
    for (const double along : {-1e6, -1.0, 1.0, 1e6}) {
      const Eigen::Vector3d moved = MoveByInverseDistance(point, along * point);
      EXPECT_GT(moved.z(), 0.0);
      EXPECT_LT(moved.z(), 10.1 * depth);
    }
  }
}

TEST(MinimizePointTest, LeavesWhatItCannotImprove) {
  const SeenPoint seen(1);
  MinimizePointOptions options;
  Eigen::Vector3d point = seen.truth;
  EXPECT_GT(MinimizePoint(options, seen.Observations(), nullptr, &point), 0.0);
  Eigen::Vector3d again = point;
  MinimizePoint(options, seen.Observations(), nullptr, &again);
  EXPECT_EQ(again, point);

  // One ray does not determine a depth. A point behind all cameras does not
  // move.
  BundleProblem::ObservationRange one = seen.Observations();
  one.last = one.first + 1;
  MinimizePoint(options, one, nullptr, &point);
  EXPECT_TRUE(point.allFinite());
  const Eigen::Vector3d behind(0.0, 0.0, -20.0);
  point = behind;
  MinimizePoint(options, seen.Observations(), nullptr, &point);
  EXPECT_EQ(point, behind);
}

}  // namespace
}  // namespace adasfm
